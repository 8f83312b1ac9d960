#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the default job and the tutorial's in rooms that others furnished, in small pictures, and says what
went wrong in them: objects that begin inside something, that leave the room, that are photographed as settled
while they move, hang in the air or are stuck, and cameras inside of things or too near to them. `diorama
lint --scenes` looks at the labels, and at what holds what in scenes that it sets up anew. The datasets stay
where --output says, for looking at the pictures.

    tests/furnished_rooms/check_rooms.py --assets-root FOLDER [--visits 10] [--output FOLDER] [--build FOLDER]

FOLDER is an assets root with /Isaac/Samples/Replicator/Infinigen/dining_rooms/ and the props of the jobs.
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
CAPTURES_PER_VISIT = 4
JOBS = {
    "dining_room": ["total_captures={captures}", "cameras[0].count=1", "cameras[0].width=320",
                    "cameras[0].height=240", "renderer.samples=4"],
    "infinigen_default": ["capture.total_captures={captures}", "capture.num_cameras=1",
                          "capture.resolution=[360, 240]", "capture.rt_subframes=4"],
}
FLAWS = ["born_inside", "left_room", "unsettled", "blocked_cameras"]


def run(options, job, output):
    command = [options.build / "bin" / "diorama", "run", ROOT / "configs" / f"{job}.yaml", "--assets-root",
               options.assets_root, "--output", output]
    for setting in JOBS[job]:
        command += ["--set", setting.format(captures=options.visits * CAPTURES_PER_VISIT)]
    begin = time.monotonic()
    ended = subprocess.run(command, stderr=subprocess.PIPE, text=True)
    if ended.returncode != 0:
        sys.exit(f"{job}: ended with {ended.returncode}: {ended.stderr[-2000:]}")
    return time.monotonic() - begin


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--assets-root", type=pathlib.Path, required=True)
    parser.add_argument("--visits", type=int, default=10)
    parser.add_argument("--output", type=pathlib.Path)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build" / "release")
    options = parser.parse_args()
    top = options.output or pathlib.Path(tempfile.mkdtemp(prefix="diorama-rooms-"))
    failed = False
    for job in JOBS:
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
