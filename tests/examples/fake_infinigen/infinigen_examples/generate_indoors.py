# SPDX-License-Identifier: Apache-2.0
"""Stands in for Infinigen's generator: takes its arguments, leaves a scene file and a trace."""
import argparse
import os
import pathlib
import sys
import time

parser = argparse.ArgumentParser()
parser.add_argument("--seed", type=int, required=True)
parser.add_argument("--task", required=True)
parser.add_argument("--output_folder", type=pathlib.Path, required=True)
parser.add_argument("-g", nargs="+", required=True)
parser.add_argument("-p", nargs="+", required=True)
args = parser.parse_args()

trace = pathlib.Path(os.environ["FAKE_INFINIGEN_TRACE"])
with (trace / f"generate_{args.seed}").open("a") as file:
    file.write(f"{time.monotonic()} {' '.join(sys.argv[1:])}\n")
time.sleep(float(os.environ.get("FAKE_INFINIGEN_SECONDS", "0")))
print("generating seed", args.seed)
if str(args.seed) in os.environ.get("FAKE_INFINIGEN_FAILING", "").split():
    sys.exit("the solver found no layout")
(args.output_folder / "scene.blend").write_text(str(args.seed))
with (trace / f"generate_{args.seed}").open("a") as file:
    file.write(f"{time.monotonic()} end\n")
