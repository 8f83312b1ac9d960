# SPDX-License-Identifier: Apache-2.0
"""Reads the lines of run_renderer.sh; prints medians of the CPU seconds and the ratios that count."""
import json
import math
import statistics
import sys
from collections import defaultdict


def objects(text):
    """The JSON objects that stand side by side in a text."""
    decoder = json.JSONDecoder()
    at = 0
    while at < len(text):
        found, at = decoder.raw_decode(text, at)
        yield found
        while at < len(text) and text[at].isspace():
            at += 1


def read(lines):
    """(materials, "run.key") -> one number per repetition."""
    values = defaultdict(list)
    for line in lines:
        run, materials, text = line.split(" ", 2)
        for found in objects(text.strip()):
            for key, value in found.items():
                if isinstance(value, (int, float)):
                    values[materials, run + "." + key].append(value)
    return values


def summarize(values, materials):
    def median(name):
        numbers = values[materials, name]
        return statistics.median(numbers) if numbers else math.nan

    def tell(what, number):
        if not math.isnan(number):
            print(f"{materials:8} {what:60} {number:.4f}")

    prepare = median("ours_64.load_cpu_s") + median("ours_64.prepare_cpu_s")
    sync = median("cycles_sync.cpu")
    whole = median("ours_64.frame_cpu_s") + prepare
    tell("64 paths at 640x480 with loading, over Cycles", whole / median("cycles_64.cpu"))
    tell("CPU seconds to load and prepare", prepare)
    tell("these over Cycles' sync", prepare / sync)
    tell("relative squared error of as many paths as 64 of Cycles need", median("ours_equal.rel_mse"))
    small = median("cycles_small.cpu") - sync
    tell("their time over 64 of Cycles, both once loaded", median("ours_equal.frame_cpu_s") / small)
    tell("relative squared error of 2 paths, denoised", median("ours_denoised.rel_mse"))
    tell("CPU seconds of these", median("ours_denoised.frame_cpu_s"))
    tell("rays, over the same rays by Embree alone", median("ours_64.raw_ray_share"))
    tell("seconds from moved things to the first ray", median("ours_64.update_wall_s"))
    tell("million paths per CPU second", 1e-6 * median("ours_64.paths_per_cpu_s"))


if __name__ == "__main__":
    lines = read(sys.stdin)
    for kind in ("diffuse", "pbr"):
        summarize(lines, kind)
