#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes a thousand captures with five conditions and three quotas (job.yaml beside this file) in shards, and
looks at the written labels alone: every picture has a target that meets all conditions, the main one of each
lies where the quotas want it, each part of a quota has its share exactly as far as captures can be shared out, and
views.json counts the same.
Refused views take at most a tenth of the time in which pictures are made, little as these take (`real_time`, one
path per pixel), and each of them at most a twentieth of a picture's.

    tests/chosen_views/check_views.py [--captures 1000] [--shards 3] [--build FOLDER]

Ends with a line of counts, and with 1 when something does not hold; the dataset is then kept.
"""
import argparse
import collections
import json
import math
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
WIDTH, HEIGHT = 640, 480
LABELS = ["capsule", "cone", "cylinder", "sphere", "cube"]
# Views are dealt in rounds: each gives every part its share, the last one as far as it comes.
SHARES = {
    "label": dict.fromkeys(LABELS, 1),
    "distance_m": {"near": 1, "far": 3},
    "direction": dict.fromkeys(range(8), 1),
}
LOWEST = math.sin(math.radians(-40))
SLACK = 1e-6  # numbers are written with fewer digits than they are judged with


def pictures(dataset):
    for archive in sorted((dataset / "web" / "shards").glob("*.tar")):
        with tarfile.open(archive) as tar:
            for member in tar:
                if member.name.endswith(".json"):
                    yield json.load(tar.extractfile(member))


def measures(thing, picture):
    pose = thing["world_from_node"]
    middle = [0.5 * (low + high) for low, high in zip(thing["bounds_min"], thing["bounds_max"])]
    way = [picture["world_from_camera"][row][3] - pose[row][3] -
           sum(pose[row][k] * middle[k] for k in range(3)) for row in range(3)]
    distance = math.dist(way, (0, 0, 0))
    left, top, right, bottom = thing["box"]
    return {
        "label": thing["class"],
        "pixels": thing["visible_px"],
        "occlusion": 1 - thing["visible_share"],
        "truncation": thing["truncation"],
        "size": max((right - left) / WIDTH, (bottom - top) / HEIGHT),
        "distance": distance,
        "azimuth": math.degrees(math.atan2(way[1], way[0])) % 360,
        "height": way[2] / distance,
    }


def meets_all(one):
    return (one["pixels"] >= 900 and one["occlusion"] <= 0.4 + SLACK and one["truncation"] <= 0.25 + SLACK and
            0.05 - SLACK <= one["size"] <= 0.8 + SLACK and one["distance"] <= 2.2 + SLACK and
            one["height"] >= LOWEST - SLACK)


def check(dataset, captures):
    faults, numbers = [], []
    parts = {"label": collections.Counter(), "distance_m": collections.Counter(), "direction": collections.Counter()}
    for picture in pictures(dataset):
        numbers.append(picture["capture"])
        holding = [one for one in (measures(thing, picture) for thing in picture["objects"]) if meets_all(one)]
        if not holding:
            faults.append(f"capture {picture['capture']}: no target meets all conditions")
            continue
        main = max(holding, key=lambda one: one["pixels"])
        if main["distance"] < 0.5 - SLACK:
            faults.append(f"capture {picture['capture']}: the main target is {main['distance']:.4f} m away")
        parts["label"][main["label"]] += 1
        parts["distance_m"]["near" if main["distance"] < 1.2 else "far"] += 1
        row = (main["height"] - LOWEST) / (1 - LOWEST) >= 0.5
        parts["direction"][int(main["azimuth"] // 90) + 4 * row] += 1
    if sorted(numbers) != list(range(captures)):
        faults.append(f"{len(set(numbers))} captures of {captures} are there")
    for quota, counts in parts.items():
        shares = SHARES[quota]
        rounds, rest = divmod(captures, sum(shares.values()))
        wanted = {part: (rounds * share, (rounds + (rest > 0)) * share) for part, share in shares.items()}
        if set(counts) - set(wanted) or any(not low <= counts[part] <= high for part, (low, high) in wanted.items()):
            faults.append(f"quota {quota}: found {dict(counts)}, expected these at least and at most: {wanted}")
    report = json.loads((dataset / "views.json").read_text())
    refused = sum(report["refused"].values())
    if report["unmet"]:
        faults.append(f"views.json names {len(report['unmet'])} views that do not hold")
    if report["views"] != captures or report["draws"] != captures + refused:
        faults.append(f"views.json: {report['views']} views, {report['draws']} draws, {refused} refused")
    return faults, report


def seconds_of_stages(log):
    stages = collections.Counter()
    times = re.search(r"time: (.*)", log)
    # A shard that has no visit says none.
    for name, seconds in re.findall(r"([a-z ]+) ([0-9.]+) s", times[1] if times else ""):
        stages[name.strip()] += float(seconds)
    return stages


def check_cost(stages, captures, refused):
    busy = sum(seconds for name, seconds in stages.items() if name not in ("loading", "waiting for writers"))
    share = stages["refusing views"] / busy
    of_picture = stages["refusing views"] / max(refused, 1) * captures / stages["rendering"]
    print(f"refusing views: {100 * share:.1f} % of the time, each {100 * of_picture:.2f} % of a picture's")
    faults = []
    if share > 0.1:
        faults.append(f"refused views take {100 * share:.1f} % of the time")
    if of_picture > 0.05:
        faults.append(f"a refused view takes {100 * of_picture:.1f} % of a picture's time")
    return faults


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--captures", type=int, default=1000, help="the default is %(default)s")
    parser.add_argument("--shards", type=int, default=3)
    parser.add_argument("--build", type=pathlib.Path, default=HERE.parents[1] / "build" / "release")
    options = parser.parse_args()
    dataset = pathlib.Path(tempfile.mkdtemp(prefix="diorama-views-")) / "out"
    stages = collections.Counter()
    for shard in range(options.shards, 0, -1):
        command = [options.build / "bin" / "diorama", "run", HERE / "job.yaml", "--output", dataset, "--shard",
                   f"{shard}/{options.shards}", "--set", f"total_captures={options.captures}"]
        ended = subprocess.run(command, stderr=subprocess.PIPE, text=True)
        if ended.returncode != 0:
            sys.exit(f"shard {shard} ended with {ended.returncode}: {ended.stderr[-2000:]}")
        stages += seconds_of_stages(ended.stderr)
    faults, report = check(dataset, options.captures)
    faults += check_cost(stages, options.captures, sum(report["refused"].values()))
    for fault in faults[:20]:
        print(fault)
    print(f"{options.captures} captures in {options.shards} shards, {report['draws']} draws: {len(faults)} faults")
    if faults:
        sys.exit(f"the dataset is kept: {dataset}")
    shutil.rmtree(dataset.parent)


if __name__ == "__main__":
    main()
