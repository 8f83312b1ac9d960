# SPDX-License-Identifier: Apache-2.0
"""What calls of components in Python cost, beyond their own work, and what the interpreter's lock costs where several
threads want it: call_cost.py PROGRAM SOURCE. Prints medians, then pictures per second."""
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

PROGRAM, SOURCE = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
SCRIPT = '''
import time
import numpy as np
import diorama.plugins as dp

class Nothing(dp.Randomizer):
    def randomize(self, scene, context, rng):
        pass

class Empty(dp.Annotator):
    needs = ["distance_to_image_plane"]
    provides = ["empty"]
    def annotate(self, frame, rng):
        return {"empty": frame.channels["distance_to_image_plane"]}

class Counts(dp.Writer):
    needs = ["color", "instances"]
    def write(self, capture, files):
        pass

class CountsEmpty(Counts):
    needs = ["color", "instances", "empty"]

class Busy(dp.Writer):
    """Holds the lock all the time that it works."""
    needs = ["color", "instances"]
    work_ms = dp.param(10.0, "Of each capture.", unit="ms")
    def write(self, capture, files):
        end = time.thread_time() + self.work_ms / 1000
        while time.thread_time() < end:
            pass

class Arrays(dp.Reader):
    patterns = ["*.npy"]
    def open(self, folder):
        return Opened(folder)

class Opened(dp.Stored):
    cameras, holds, captures = ["eye"], ["color", "instances", "tight_boxes"], range(60)
    def __init__(self, folder):
        self.color = np.load(folder / "a.npy")
    def read(self, place, wanted):
        return dp.Capture(place, frames=[dp.Frame("eye", dp.Camera(640, 480), channels={"color": self.color})])

def timed(name):
    inner = getattr(dp, name)
    def outer(*arguments):
        begin = time.perf_counter()
        inner(*arguments)
        print(name, 1e6 * (time.perf_counter() - begin), flush=True)
    setattr(dp, name, outer)

import os
if "TIMED" in os.environ:
    for name in ("_randomize", "_annotate", "_write", "_read"):
        timed(name)
'''


def call(folder, *arguments, **environment):
    result = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, cwd=folder,
                            env={**os.environ, "DIORAMA_PYTHON_PATH": str(folder), **environment})
    if result.returncode != 0:
        sys.exit(result.stdout + result.stderr)
    return result.stdout


def run(folder, writers, *sets, threads=1, captures=60, **environment):
    arguments = ["run", SOURCE / "configs/smoke.yaml", "--output", folder / f"out{time.monotonic_ns()}", "--threads", str(threads)]
    for each in (f"total_captures={captures}", "cameras.cam.width=640", "cameras.cam.height=480", "cameras.cam.count=1",
                 "timeline=[{capture: floating, count: 6}]", f"writers=[{writers}]", *sets):
        arguments += ["--set", each]
    begin = time.monotonic()
    told = call(folder, *arguments, **environment)
    return told, time.monotonic() - begin


def script(kind, name, more=""):
    return f"{{type: python, name: {kind}, file: cost.py, class: {name}{more}}}"


with tempfile.TemporaryDirectory() as folder:
    folder = pathlib.Path(folder)
    (folder / "cost.py").write_text(SCRIPT)
    told, _ = run(folder, script("own", "CountsEmpty"), f"randomizers.cameras={script('cameras', 'Nothing', ', on: [floating]')}",
                  "annotators=[{type: python, file: cost.py, class: Empty}]", TIMED="1")
    data = folder / "data"
    data.mkdir()
    np.save(data / "a.npy", np.zeros((480, 640, 4), np.uint8))
    told += call(folder, "--threads", "1", "lint", data, TIMED="1")
    for name in ("_randomize", "_annotate", "_write", "_read"):
        times = [float(line.split()[1]) for line in told.splitlines() if line.startswith(name + " ")]
        print(f"{name[1:]}: {statistics.median(times):.0f} us, median of {len(times)}")
    for title, writer in (("BasicWriter, colour", "{type: BasicWriter, name: own, rgb: true}"), ("10 ms of Python a capture", script("own", "Busy"))):
        speeds = [240 / run(folder, writer, "randomizers=[]", "cameras.cam.width=96", "cameras.cam.height=72",
                                threads=threads, captures=240)[1] for threads in (1, 2)]
        print(f"{title}: {speeds[0]:.0f} captures/s with 1 thread, {speeds[1]:.0f} with 2")
