#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs long jobs and watches the memory of the program. See run.sh beside it."""
import argparse
import os
import pathlib
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

WARM_UP = 50  # captures until all caches are full
MOST_GROWTH = 0.05
SECONDS_PER_CAPTURE = 30  # a run that is slower hangs
MARKS = (50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000)  # captures of which the memory is told
STOPPED = 130  # the program's exit code when it was asked to stop
SECONDS_TO_STOP = 60
CACHE_MIB = 2  # for assets: less than the rooms take, so that they come and go

STILLS = """  - simulate: 4
  - {capture: floating, count: 8}
  - simulate: 4
  - {capture: dropped, count: 8}"""
CLIPS = """  - simulate: 4
  - record: {name: floating, fps: 20, seconds: 0.4}
  - simulate: 4
  - record: {name: dropped, fps: 20, seconds: 0.4}"""
USUAL = ("null", "path_traced", "real_time", "clips")
# What a run is called, its renderer and timeline; some writers have work with clips alone.
RUNS = {
    "null": ('{type: "null"}', STILLS),
    "path_traced": ("{type: embree, samples: 1}", STILLS),
    "real_time": ("{type: embree, mode: real_time, samples: 1}", STILLS),
    "vulkan": ("{type: vulkan, samples: 1}", STILLS),
    "clips": ('{type: "null"}', CLIPS),
}

JOB = """
seed: 5
total_captures: %(captures)d
environments:
  - {type: dining_room, first_seed: 1, count: 4}
environment:
  colliders: triangle_mesh
  working_area: TableDining
objects:
  - {type: files, name: targets, folders: [/Isaac/Props/YCB/Axis_Aligned/], under: /Assets, count: 6,
     label_pattern: "^[0-9]+_", label_replacement: ""}
  - {type: shapes, name: shapes, under: /Distractors, count: 6}
lights:
  - {type: sphere, name: lamp, count: 2, radius_m: 0.1}
  - {type: dome, name: sky}
cameras:
  - {type: pinhole, name: cam, count: 1, width: 48, height: 32}
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*",
     offset: [[-0.5, 0.5], [-0.5, 0.5], [1.0, 1.5]], scale: [0.9, 1.2]}
  - {type: scatter_poses, name: shape_poses, on: [environment], nodes: "/Distractors/*",
     offset: [[-1.0, 1.0], [-1.0, 1.0], [1.0, 1.6]], scale: [0.02, 0.08]}
  - {type: random_colors, name: colors, on: [floating, dropped], nodes: "/Distractors/**"}
  - {type: dome_light, name: sky, on: [floating], nodes: "/Lights/sky_*", intensity: 1000,
     textures: [/NVIDIA/Assets/Skies/Clear/noon_grass_4k.hdr, /NVIDIA/Assets/Skies/Clear/qwantani_4k.hdr]}
  - {type: orbit_cameras, name: cameras, on: [floating, dropped], nodes: "/Cameras/*",
     targets: "/Assets/*", distance: [1.0, 2.0], polar_angle_deg: [10, 60]}
renderer: %(renderer)s
timeline:
%(timeline)s
writers:
%(writers)s
output:
  folder: out
"""


def writer_types(program):
    """Of every writer that the program knows, with what it needs to be told."""
    listed = subprocess.run(program + ["plugins"], check=True, capture_output=True, text=True)
    types = sorted({word for line in listed.stdout.splitlines() for word in line.split()
                    if word.endswith("Writer")})
    if "BasicWriter" not in types:
        sys.exit("soak: the program lists no BasicWriter: " + listed.stdout)
    return types


def writer_lines(types):
    lines = []
    for kind in types:
        more = ", rgb: true, distance_to_camera: true, instance_segmentation: true" \
            if kind == "BasicWriter" else ""
        lines.append("  - {type: %s, name: %s%s}" % (kind, kind.lower(), more))
    return "\n".join(lines)


def captures_in(folder):
    """One camera: as many as there are pictures."""
    try:
        return sum(1 for entry in os.scandir(folder) if entry.name.startswith("rgb_"))
    except FileNotFoundError:
        return 0


def rss_mib(process):
    try:
        for line in pathlib.Path("/proc/%d/status" % process.pid).read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) / 1024
    except (FileNotFoundError, ProcessLookupError):
        pass
    return None


def watch(program, job, folder, captures, seconds):
    """Runs the job, at most for some seconds when those are given; returns (captures done, MiB) at intervals."""
    file = folder / "job.yaml"
    file.write_text(job)
    log = (folder / "log").open("w")
    process = subprocess.Popen(program + ["--asset-cache-mib", str(CACHE_MIB), "run", str(file),
                                          "--output", str(folder / "out")],
                               stdout=log, stderr=log, cwd=folder)
    samples = []
    begin = time.monotonic()
    deadline = begin + SECONDS_PER_CAPTURE * captures
    allowed = {0}
    try:
        while process.poll() is None and time.monotonic() < deadline:
            done = captures_in(folder / "out" / "basicwriter")
            memory = rss_mib(process)
            if memory is not None:
                samples.append((done, memory))
            if seconds and allowed == {0} and time.monotonic() > begin + seconds:
                process.send_signal(signal.SIGTERM)
                allowed = {0, STOPPED}
                deadline = time.monotonic() + SECONDS_TO_STOP
            time.sleep(max(0.1, captures / 20000))
    finally:
        process.kill()
        process.wait()
    if process.returncode not in allowed:
        sys.exit("soak: exit code %d\n%s" % (process.returncode, (folder / "log").read_text()[-3000:]))
    done = captures_in(folder / "out" / "basicwriter")
    if done != captures and process.returncode != STOPPED:
        sys.exit("soak: the run ended with %d of %d captures" % (done, captures))
    return samples


def check(name, samples):
    """Memory towards the end against memory after the warm-up; both are medians of many samples."""
    captures = samples[-1][0] if samples else 0
    rest = captures - WARM_UP
    begin = [m for done, m in samples if WARM_UP <= done < WARM_UP + rest / 4]
    end = [m for done, m in samples if done >= captures - rest / 4]
    if len(begin) < 3 or len(end) < 3:
        sys.exit("soak: %s: too few samples to judge (%d and %d of %d captures); ask for more captures"
                 % (name, len(begin), len(end), captures))
    growth = statistics.median(end) / statistics.median(begin) - 1
    print("%-11s %6d captures: %7.1f MiB after the warm-up, %7.1f MiB at the end (%+.1f %%), most %.1f"
          % (name, captures, statistics.median(begin), statistics.median(end), 100 * growth,
             max(m for _, m in samples)), flush=True)
    marks = [mark for mark in MARKS if mark < captures] + [captures]
    print("%-11s MiB at: %s" % ("", ", ".join(
        "%d: %.0f" % (mark, next(m for done, m in samples if done >= mark)) for mark in marks)), flush=True)
    return growth <= MOST_GROWTH


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", required=True, type=pathlib.Path)
    parser.add_argument("--captures", type=int, default=10000)
    parser.add_argument("--seconds", type=float, help="until a run is stopped and judged (default: no limit)")
    parser.add_argument("--renderer", action="append", choices=sorted(RUNS))
    options = parser.parse_args()
    if options.captures < 2 * WARM_UP:
        sys.exit("soak: at least %d captures are needed" % (2 * WARM_UP))
    build = options.build.resolve()
    program = [str(build / "bin" / "diorama"), "--plugin-dir", str(build / "plugins")]
    writers = writer_lines(writer_types(program))
    is_flat = True
    for name in options.renderer or USUAL:
        folder = pathlib.Path(tempfile.mkdtemp(prefix="diorama-soak-"))
        try:
            renderer, timeline = RUNS[name]
            job = JOB % {"captures": options.captures, "renderer": renderer, "timeline": timeline,
                         "writers": writers}
            is_flat &= check(name, watch(program, job, folder, options.captures, options.seconds))
        finally:
            shutil.rmtree(folder)
    if not is_flat:
        sys.exit("soak: memory grew by more than %.0f %%" % (100 * MOST_GROWTH))


if __name__ == "__main__":
    main()
