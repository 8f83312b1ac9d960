#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the default job and the tutorial's in rooms that others furnished, in small pictures, and says what
went wrong in them: objects that begin inside something, that leave the room, that are photographed as settled
while they move, hang in the air or are stuck, and cameras inside of things or too near to them. `diorama
lint --scenes` looks at the labels, and at what holds what in scenes that it sets up anew. The datasets stay
where --output says, for looking at the pictures.

    tests/furnished_rooms/check_rooms.py --assets-root FOLDER [--visits 10] [--seed N] [--job NAME] [--tiny]
                                         [--output FOLDER] [--build FOLDER]

FOLDER is an assets root with /Isaac/Samples/Replicator/Infinigen/dining_rooms/ and the props of the jobs. `--tiny`
makes pictures of one path and few pixels: what stands where is the same. Other seeds fill rooms otherwise.
Ends with a table, and with 1 when anything was found.
"""
import argparse
import collections
import json
import pathlib
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
TUTORIAL = ["capture.total_captures={captures}", "capture.num_cameras=1", "capture.resolution=[{width}, {height}]",
            "capture.rt_subframes={paths}", "capture.path_tracing=false"]
JOBS = {  # captures of a visit, settings
    "dining_room": (4, ["total_captures={captures}", "cameras[0].count=1", "cameras[0].width={width}",
                        "cameras[0].height={height}", "renderer.samples={paths}"]),
    "infinigen_default": (4, TUTORIAL),
    "infinigen_multi_writers_pt": (5, TUTORIAL),
}
FULL = {"width": 320, "height": 240, "paths": 4}
TINY = {"width": 96, "height": 72, "paths": 1}
FLAWS = ["born_inside", "left_room", "unsettled", "blocked_cameras"]


def run(options, job, output):
    command = [options.build / "bin" / "diorama", "run", ROOT / "configs" / f"{job}.yaml", "--assets-root",
               options.assets_root, "--output", output]
    if options.seed is not None:
        command += ["--seed", str(options.seed)]
    per_visit, settings = JOBS[job]
    for setting in settings:
        command += ["--set", setting.format(captures=options.visits * per_visit, **(TINY if options.tiny else FULL))]
    begin = time.monotonic()
    ended = subprocess.run(command, stderr=subprocess.PIPE, text=True)
    if ended.returncode != 0:
        sys.exit(f"{job}: ended with {ended.returncode}: {ended.stderr[-2000:]}")
    return time.monotonic() - begin


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--assets-root", type=pathlib.Path, required=True)
    parser.add_argument("--visits", type=int, default=10)
    parser.add_argument("--seed", type=int, help="instead of the jobs'")
    parser.add_argument("--job", choices=JOBS, action="append", help="all of them when absent")
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--output", type=pathlib.Path)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build" / "release")
    options = parser.parse_args()
    top = options.output or pathlib.Path(tempfile.mkdtemp(prefix="diorama-rooms-"))
    failed = False
    for job in options.job or JOBS:
        seconds = run(options, job, top / job)
        counts = collections.Counter()
        reports = sorted((top / job).rglob("settle/*.json"))
        for report in reports:
            visit = json.loads(report.read_text())
            counts["respawned"] += len(visit["respawned"])
            counts["dropped"] += len(visit["dropped"])
            for flaw in FLAWS:
                counts[flaw] += len(visit[flaw])
                for found in visit[flaw]:
                    print(f"{job}, visit {visit['visit'] + 1}: {flaw}: {found}")
        if not reports:
            sys.exit(f"{job}: wrote no settle/")
        lint = subprocess.run([options.build / "bin" / "diorama", "lint", "--scenes", reports[0].parents[1],
                               "--assets-root", options.assets_root], stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True)
        if lint.returncode != 0:
            print(lint.stdout[-2000:])
        is_whole = len(reports) == options.visits
        failed |= lint.returncode != 0 or not is_whole or any(counts[flaw] for flaw in FLAWS)
        print(f"{job}: {len(reports)} of {options.visits} visits, " +
              ", ".join(f"{name} {counts[name]}" for name in FLAWS + ["respawned", "dropped"]) +
              f", lint {'passed' if lint.returncode == 0 else 'FAILED'}, {seconds:.0f} s")
    print(f"pictures: {top}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
