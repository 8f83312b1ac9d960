# SPDX-License-Identifier: Apache-2.0
"""What calls of components in Python cost, beyond their own work: call_cost.py PROGRAM SOURCE. Prints medians."""
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

PROGRAM, SOURCE = sys.argv[1], pathlib.Path(sys.argv[2])
SCRIPT = '''
import time
import diorama.plugins as dp

class Nothing(dp.Randomizer):
    def randomize(self, scene, context, rng):
        pass

class Counts(dp.Writer):
    needs = ["color", "instances"]
    def write(self, capture, files):
        pass

def timed(name):
    inner = getattr(dp, name)
    def outer(*arguments):
        begin = time.perf_counter()
        inner(*arguments)
        print(name, 1e6 * (time.perf_counter() - begin), flush=True)
    setattr(dp, name, outer)

timed("_randomize")
timed("_write")
'''

with tempfile.TemporaryDirectory() as folder:
    (pathlib.Path(folder) / "cost.py").write_text(SCRIPT)
    sets = ["total_captures=60", "cameras.cam.width=640", "cameras.cam.height=480", "cameras.cam.count=1", "timeline=[{capture: floating, count: 6}]",
            "randomizers.cameras={type: python, name: cameras, on: [floating], file: cost.py, class: Nothing}",
            "writers=[{type: python, name: own, file: cost.py, class: Counts}]"]
    arguments = [PROGRAM, "run", SOURCE / "configs/smoke.yaml", "--output", pathlib.Path(folder) / "out", "--threads", "1"]
    for each in sets:
        arguments += ["--set", each]
    result = subprocess.run(arguments, capture_output=True, text=True, env={**os.environ, "DIORAMA_PYTHON_PATH": folder})
    if result.returncode != 0:
        sys.exit(result.stderr)
    for name in ("_randomize", "_write"):
        times = [float(line.split()[1]) for line in result.stdout.splitlines() if line.startswith(name + " ")]
        print(f"{name[1:]}: {statistics.median(times):.0f} us, median of {len(times)}")
