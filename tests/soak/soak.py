#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Long runs hold no more memory than short ones: runs jobs side by side and judges the memory of each. See
run.sh beside it.

The program tells its memory (resident set) with every capture. Environments come and go in a cycle, so memory swings
with it, and a visit that is being loaded holds more for a moment; how many captures meet one depends on what else the
machine does. The lower quartile of whole cycles is what stays. That of the cycles after the first 50 captures is held against
that of the last ones: what grows by more than 5 % fails. The slope beside it (the median of the slopes between the
quartiles of any two cycles, which outliers do not move) tells a leak from a cache that fills.
"""
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
import threading
import time

WARM_UP = 50  # captures until all caches are full
MOST_GROWTH = 0.05
SECONDS_PER_CAPTURE = 30  # a run that is slower hangs
STOPPED = 130  # the program's exit code when it was asked to stop
SECONDS_TO_STOP = 60
SAY_EVERY_S = 30
ENVIRONMENTS = 4  # of a cycle
CYCLES = 4  # that are judged at either end
VISITS = 200  # of a long run, each of which loads what the cache has dropped
# What may be held at once is bounded by these, whatever the machine; each is less than the job could fill.
BOUNDS = ["--asset-cache-mib", "2"]  # less than the rooms take, so that assets come and go
RUN_BOUNDS = ["--visits-in-flight", "2", "--queue-mib", "8"]

ROOMS = """environments:
  - {type: dining_room, first_seed: 1, count: 4}
environment:
  colliders: triangle_mesh
  working_area: TableDining"""
# For writers, which do not see what rooms are made of, and wait for them to be made.
SOLIDS = """environments:
  - {type: shapes, shapes: [cube, sphere, cone, cylinder]}
environment:
  colliders: triangle_mesh"""
SKIES = "/NVIDIA/Assets/Skies/Clear/noon_grass_4k.hdr, /NVIDIA/Assets/Skies/Clear/qwantani_4k.hdr"

# Of a visit; a half of its captures each.
STILLS = """  - simulate: 1
  - {capture: floating, count: %(half)d}
  - simulate: 1
  - {capture: dropped, count: %(half)d}"""
CLIPS = """  - simulate: 1
  - record: {name: floating, fps: 20, seconds: %(half_s)g}
  - simulate: 1
  - record: {name: dropped, fps: 20, seconds: %(half_s)g}"""
FOR_CLIPS = ("MotWriter", "VideoWriter")  # have work with clips alone
# What a run of all writers is called, its renderer and timeline.
RENDERERS = {
    "null": ('{type: "null"}', STILLS),
    "path_traced": ("{type: embree, samples: 1}", STILLS),
    "real_time": ("{type: embree, mode: real_time, samples: 1}", STILLS),
    "vulkan": ("{type: vulkan, samples: 1}", STILLS),
    "clips": ('{type: "null"}', CLIPS),
}

JOB = """
seed: 5
total_captures: %(captures)d
%(environment)s
objects:  # of one size each: BOP has a model per size
  - {type: files, name: targets, folders: [/Isaac/Props/YCB/Axis_Aligned/], under: /Assets, count: 6,
     label_pattern: "^[0-9]+_", label_replacement: ""}
  - {type: shapes, name: shapes, under: /Distractors, count: 6}
lights:
  - {type: sphere, name: lamp, count: 2, radius_m: 0.1}
  - {type: dome, name: sky}
cameras:
  - {type: pinhole, name: cam, count: 1, width: %(width)d, height: %(height)d}
randomizers:
  - {type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*",
     offset: [[-0.5, 0.5], [-0.5, 0.5], [1.0, 1.5]]}
  - {type: scatter_poses, name: shape_poses, on: [environment], nodes: "/Distractors/*",
     offset: [[-1.0, 1.0], [-1.0, 1.0], [1.0, 1.6]], scale: [0.02, 0.08]}
  - {type: random_colors, name: colors, on: [floating, dropped], nodes: "/Distractors/**"}
  - {type: dome_light, name: sky, on: [floating], nodes: "/Lights/sky_*", intensity: 1000,
     textures: [%(skies)s]}
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


class Fault(Exception):
    """A run that failed or cannot be judged."""


def writer_types(program):
    """Every writer that the program knows."""
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


class Run:
    """One job, from its start to its row of the table."""

    def __init__(self, name, renderer, writers, environment=ROOMS, skies=SKIES):
        self.name, self.renderer, self.writers = name, renderer, writers
        self.environment, self.skies = environment, skies
        self.folder = None  # while it runs
        self.seconds = 0.0

    def job(self, options):
        renderer, timeline = RENDERERS[self.renderer]
        half = options.per_visit // 2
        width, height = options.size
        return JOB % {"captures": options.captures, "width": width, "height": height,
                      "environment": self.environment, "skies": self.skies, "renderer": renderer,
                      "writers": writer_lines(self.writers), "timeline": timeline % {"half": half, "half_s": half / 20}}

    def memory(self):
        """MiB after each capture that is on disk so far."""
        folder = self.folder
        if folder is None:
            return []
        try:
            lines = (folder / "progress").read_text().split("\n")[:-1]
        except FileNotFoundError:  # not there yet, or no more
            return []
        memory = []
        for line in map(json.loads, lines):
            memory += [line["rss_mib"]] * (line["done"] - len(memory))
        return memory

    def make(self, program, options):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="diorama-soak-"))
        file = self.folder / "job.yaml"
        file.write_text(self.job(options))
        begin = time.monotonic()
        with (self.folder / "progress").open("w") as progress, (self.folder / "log").open("w") as log:
            process = subprocess.Popen(
                program + BOUNDS + ["run", str(file), "--output", str(self.folder / "out"), "--progress", "json"] +
                RUN_BOUNDS, stdout=progress, stderr=log, cwd=self.folder)
        is_stopped = False
        try:
            limit = options.seconds or SECONDS_PER_CAPTURE * options.captures
            try:
                process.wait(limit)
            except subprocess.TimeoutExpired:
                is_stopped = options.seconds is not None
                if is_stopped:
                    process.send_signal(signal.SIGTERM)
                    process.wait(SECONDS_TO_STOP)
        except subprocess.TimeoutExpired:
            pass
        finally:
            process.kill()
            process.wait()
            self.seconds = time.monotonic() - begin
        if process.returncode != 0 and not (is_stopped and process.returncode == STOPPED):
            raise Fault("exit code %d\n%s" % (process.returncode, (self.folder / "log").read_text()[-3000:]))
        done = len(self.memory())
        if done != options.captures and process.returncode != STOPPED:
            raise Fault("the run ended with %d of %d captures" % (done, options.captures))

    def judge(self, program, options):
        """Returns whether memory is flat, and the row."""
        try:
            self.make(program, options)
            memory = self.memory()
            is_flat, text = verdict(memory, ENVIRONMENTS * options.per_visit)
            text = "%-28s %8d %6.0f %s" % (self.name, len(memory), self.seconds, text)
        except Fault as fault:
            is_flat, text = False, "%-28s FAILED: %s" % (self.name, fault)
        finally:
            folder, self.folder = self.folder, None
            shutil.rmtree(folder)
        return is_flat, text


HEAD = "%-28s %8s %6s %9s %9s %7s %9s %12s  %s" % ("run", "captures", "s", "MiB at 50", "at end", "growth", "most",
                                                 "MiB per 1000", "")


def what_stays(memory):
    return statistics.quantiles(memory, n=4)[0]


def verdict(memory, cycle):
    """Whether the memory is flat, and what is to be told of it."""
    judged = memory[WARM_UP:]
    window = cycle * min(CYCLES, len(judged) // (2 * cycle))
    if window == 0:
        raise Fault("%d captures are too few to judge, at least %d are needed" % (len(memory), WARM_UP + 2 * cycle))
    begin, end = what_stays(judged[:window]), what_stays(judged[-window:])
    cycles = [what_stays(judged[at:at + cycle]) for at in range(0, len(judged) - cycle + 1, cycle)]
    slopes = [(later - earlier) / ((j - i) * cycle) for i, earlier in enumerate(cycles)
              for j, later in enumerate(cycles[i + 1:], i + 1)]
    growth = end / begin - 1
    is_flat = growth <= MOST_GROWTH
    return is_flat, "%9.1f %9.1f %+6.1f%% %9.1f %12.2f  %s" % (
        begin, end, 100 * growth, max(memory), 1000 * statistics.median(slopes), "flat" if is_flat else "GROWS")


def tell_progress(runs, captures, ended):
    while not ended.wait(SAY_EVERY_S):
        going = ["%s %d" % (run.name, len(run.memory())) for run in runs if run.folder]
        print("of %d captures: %s" % (captures, ", ".join(going)), flush=True)


def picture_size(text):
    width, height = (int(number) for number in text.split("x"))
    if width <= 0 or height <= 0:
        raise ValueError
    return width, height


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--build", required=True, type=pathlib.Path)
    parser.add_argument("--captures", type=int, default=10000)
    parser.add_argument("--per-visit", type=int, help="captures of a visit, an even number (default: for %d visits, "
                        "4 at least)" % VISITS)
    parser.add_argument("--size", type=picture_size, default=(48, 32), metavar="WIDTHxHEIGHT",
                        help="of the pictures (default: 48x32)")
    parser.add_argument("--seconds", type=float, help="until a run is stopped and judged (default: no limit)")
    parser.add_argument("--run", action="append", metavar="NAME",
                        help="these alone; vulkan, which needs a device, is run when it is named only")
    parser.add_argument("--at-once", type=int, help="runs side by side (default: all, as far as there are cores)")
    parser.add_argument("--threads", type=int, help="of a run (default: what is left of the cores, at least 2)")
    options = parser.parse_args()
    if options.per_visit is None:
        options.per_visit = max(4, options.captures // VISITS // 2 * 2)
    if options.per_visit < 2 or options.per_visit % 2:
        sys.exit("soak: --per-visit needs an even number")
    build = options.build.resolve()
    program = [str(build / "bin" / "diorama"), "--plugin-dir", str(build / "plugins")]
    types = writer_types(program)
    runs = [Run(name, name, types) for name in RENDERERS]
    runs += [Run(kind, "clips" if kind in FOR_CLIPS else "null", [kind], SOLIDS, "") for kind in types]
    names = [run.name for run in runs]
    for name in options.run or []:
        if name not in names:
            sys.exit("soak: there is no run '%s'; there are %s" % (name, ", ".join(names)))
    runs = [run for run in runs if (run.name in options.run if options.run else run.name != "vulkan")]
    cores = len(os.sched_getaffinity(0))
    at_once = options.at_once or max(1, min(len(runs), cores))
    program += ["--threads", str(options.threads or max(2, cores // at_once))]

    ended = threading.Event()
    talker = threading.Thread(target=tell_progress, args=(runs, options.captures, ended), daemon=True)
    talker.start()
    with concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        rows = list(pool.map(lambda run: run.judge(program, options), runs))
    ended.set()
    print(HEAD)
    for _, text in rows:
        print(text)
    failed = [run.name for run, (is_flat, _) in zip(runs, rows) if not is_flat]
    if failed:
        sys.exit("soak: memory grew by more than %.0f %%, or the run failed: %s"
                 % (100 * MOST_GROWTH, ", ".join(failed)))
    print("soak: all %d runs are flat" % len(runs))


if __name__ == "__main__":
    main()
