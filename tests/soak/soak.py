#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs long jobs and watches the memory of the program. See run.sh beside it."""
import argparse
import concurrent.futures
import json
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
LAST_LINES = 1000  # bytes of progress in which a whole line lies
CACHE_MIB = 2  # for assets: less than the rooms take, so that they come and go

# Of a visit; a half of its captures each.
STILLS = """  - simulate: 4
  - {capture: floating, count: %(half)d}
  - simulate: 4
  - {capture: dropped, count: %(half)d}"""
CLIPS = """  - simulate: 4
  - record: {name: floating, fps: 20, seconds: %(half_s)g}
  - simulate: 4
  - record: {name: dropped, fps: 20, seconds: %(half_s)g}"""
FOR_CLIPS = ("MotWriter", "VideoWriter")  # have work with clips alone
USUAL = ("null", "path_traced", "real_time", "clips")
# What a run is called, its renderer and timeline.
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
     offset: [[-0.5, 0.5], [-0.5, 0.5], [1.0, 1.5]], scale: {choice: {choices: [0.9, 1.05, 1.2]}}}  # BOP has a model per size
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


class Fault(Exception):
    """A run that failed or cannot be judged."""


def captures_done(folder):
    """As the newest line of progress says."""
    try:
        with (folder / "progress").open("rb") as file:
            file.seek(0, os.SEEK_END)
            file.seek(max(0, file.tell() - LAST_LINES))
            lines = file.read().split(b"\n")
        return json.loads(lines[-2])["done"] if len(lines) > 1 else 0
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
    with (folder / "progress").open("w") as progress, (folder / "log").open("w") as log:
        process = subprocess.Popen(program + ["--asset-cache-mib", str(CACHE_MIB), "run", str(file),
                                              "--output", str(folder / "out"), "--progress", "json"],
                                   stdout=progress, stderr=log, cwd=folder)
    samples = []
    begin = time.monotonic()
    deadline = begin + SECONDS_PER_CAPTURE * captures
    allowed = {0}
    try:
        while process.poll() is None and time.monotonic() < deadline:
            done = captures_done(folder)
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
        raise Fault("exit code %d\n%s" % (process.returncode, (folder / "log").read_text()[-3000:]))
    done = captures_done(folder)
    if done != captures and process.returncode != STOPPED:
        raise Fault("the run ended with %d of %d captures" % (done, captures))
    return samples


def verdict(name, samples):
    """Memory towards the end against memory after the warm-up; both are medians of many samples. Returns lines to
    print and whether it is flat."""
    captures = samples[-1][0] if samples else 0
    rest = captures - WARM_UP
    begin = [m for done, m in samples if WARM_UP <= done < WARM_UP + rest / 4]
    end = [m for done, m in samples if done >= captures - rest / 4]
    if len(begin) < 3 or len(end) < 3:
        raise Fault("too few samples to judge (%d and %d of %d captures); ask for more captures"
                    % (len(begin), len(end), captures))
    growth = statistics.median(end) / statistics.median(begin) - 1
    is_flat = growth <= MOST_GROWTH
    marks = [mark for mark in MARKS if mark < captures] + [captures]
    return ("%-24s %-5s %6d captures: %7.1f MiB after the warm-up, %7.1f MiB at the end (%+.1f %%), most %.1f\n"
            "%-30s MiB at: %s"
            % (name, "flat" if is_flat else "GROWS", captures, statistics.median(begin), statistics.median(end),
               100 * growth, max(m for _, m in samples), "", ", ".join(
                   "%d: %.0f" % (mark, next(m for done, m in samples if done >= mark)) for mark in marks))), is_flat


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", required=True, type=pathlib.Path)
    parser.add_argument("--captures", type=int, default=10000)
    parser.add_argument("--per-visit", type=int, default=16, help="captures of a visit, an even number")
    parser.add_argument("--seconds", type=float, help="until a run is stopped and judged (default: no limit)")
    parser.add_argument("--renderer", action="append", choices=sorted(RUNS))
    parser.add_argument("--alone", action="store_true", help="instead, each writer alone, without a renderer")
    parser.add_argument("--at-once", type=int, default=1, help="runs side by side")
    parser.add_argument("--threads", type=int, default=0, help="of a run (default: all of the machine)")
    options = parser.parse_args()
    if options.captures < 2 * WARM_UP:
        sys.exit("soak: at least %d captures are needed" % (2 * WARM_UP))
    if options.per_visit < 2 or options.per_visit % 2:
        sys.exit("soak: --per-visit needs an even number")
    build = options.build.resolve()
    program = [str(build / "bin" / "diorama"), "--plugin-dir", str(build / "plugins"),
               "--threads", str(options.threads)]
    types = writer_types(program)
    if options.alone:
        runs = [(kind, "clips" if kind in FOR_CLIPS else "null", [kind]) for kind in types]
    else:
        runs = [(name, name, types) for name in options.renderer or USUAL]

    def tell(run):
        """Whether the memory of a run is flat."""
        name, kind, writers = run
        renderer, timeline = RUNS[kind]
        half = options.per_visit // 2
        job = JOB % {"captures": options.captures, "renderer": renderer, "writers": writer_lines(writers),
                     "timeline": timeline % {"half": half, "half_s": half / 20}}
        folder = pathlib.Path(tempfile.mkdtemp(prefix="diorama-soak-"))
        try:
            text, is_flat = verdict(name, watch(program, job, folder, options.captures, options.seconds))
        except Fault as fault:
            text, is_flat = "%-24s FAILED: %s" % (name, fault), False
        finally:
            shutil.rmtree(folder)
        print(text, flush=True)
        return is_flat

    with concurrent.futures.ThreadPoolExecutor(options.at_once) as pool:
        failed = [run[0] for run, is_flat in zip(runs, pool.map(tell, runs)) if not is_flat]
    if failed:
        sys.exit("soak: memory grew by more than %.0f %%, or the run failed: %s"
                 % (100 * MOST_GROWTH, ", ".join(failed)))
    print("soak: all %d runs are flat" % len(runs))


if __name__ == "__main__":
    main()
