# SPDX-License-Identifier: Apache-2.0
"""Stands in for Infinigen's exporter: a generated scene becomes the room given by the test."""
import argparse
import os
import pathlib
import shutil
import sys

parser = argparse.ArgumentParser()
parser.add_argument("--input_folder", type=pathlib.Path, required=True)
parser.add_argument("--output_folder", type=pathlib.Path, required=True)
parser.add_argument("-f", required=True)
parser.add_argument("-r", type=int, required=True)
parser.add_argument("--omniverse", action="store_true")
args = parser.parse_args()

seed = (args.input_folder / "scene.blend").read_text()
trace = pathlib.Path(os.environ["FAKE_INFINIGEN_TRACE"])
with (trace / f"export_{seed}").open("a") as file:
    file.write(" ".join(sys.argv[1:]) + "\n")
target = args.output_folder / "export_scene.blend"
target.mkdir(exist_ok=True)
if seed in os.environ.get("FAKE_INFINIGEN_BROKEN", "").split():
    (target / "export_scene.usdc").write_bytes(b"PXR-USDC cut short")
else:
    shutil.copy(os.environ["FAKE_INFINIGEN_ROOM"], target / "export_scene.usdc")
