#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Shards that work on one folder at the same time are killed, stopped, started twice and given a slow and
faulty file system, until a number of kills and faults is reached. What must hold for every round:

- a process that nobody disturbed ends with 0, or with 75 while another one owns its shard;
- one whose file system failed ends with 0, 6 or 75, and says why;
- when all shards were started once more and ended, the dataset has the files of one undisturbed run, byte
  by byte.

    tests/cluster/torture.py --kills 1000 --faults 5000 [--build FOLDER] [--seed N] [--seconds N] [--at-once N]

Says every half minute what was done so far; ends with a line of counts, and with 1 when something did not
hold; then the folders of that round are kept. With --seconds no round begins after that time; it ends with 1
when it came to none of the kills or faults that were asked for.
"""
import argparse
import collections
import concurrent.futures
import errno
import filecmp
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
SHARDS = 4
DELAYS_MS = [0, 0, 0, 2, 2, 2, 2, 120]  # of every file operation in a round
ERRORS = [errno.ENOSPC, errno.EIO, errno.EDQUOT, errno.EACCES, errno.ESTALE, errno.EMFILE]
RETRY_LATER = 75
STOPPED = 130
SAY_EVERY_S = 30


class Round:
    """One dataset, from the first start to the comparison."""

    def __init__(self, torture, number):
        self.torture = torture
        self.rng = random.Random(f"{torture.options.seed}/{number}")
        self.folder = torture.work / f"round_{number}"
        self.folder.mkdir()
        self.dataset = self.folder / "dataset"
        self.delay_ms = self.rng.choice(DELAYS_MS)
        self.starts = 0
        self.faults = []

    def start(self, shard, environment=None):
        log = self.folder / f"{self.starts}_shard_{shard}.log"
        self.starts += 1
        with open(log, "wb") as file:
            process = subprocess.Popen(
                [self.torture.program, "run", HERE / "job.yaml", "--output", self.dataset, "--resume",
                 "--threads", "2", "--shard", f"{shard}/{SHARDS}", *self.torture.smaller()],
                stdout=file, stderr=file,
                env={**os.environ, "LD_PRELOAD": str(self.torture.library),
                     "SLOW_FILES_MS": str(self.delay_ms), **(environment or {})})
        process.log, process.shard, process.disturbed = log, shard, bool(environment)
        return process

    def check(self, process):
        """Of a process that has ended."""
        code = process.returncode
        allowed = {0, RETRY_LATER}
        if process.disturbed == "killed":
            allowed |= {-signal.SIGKILL, -signal.SIGTERM, -signal.SIGINT, STOPPED}
        elif process.disturbed:
            allowed |= {6}
        text = process.log.read_text(errors="replace")
        if code not in allowed:
            last = text.strip().splitlines()[-1:] or ["(no output)"]
            self.faults.append(f"shard {process.shard} ended with {code}: {last[0][-200:]}")
        elif code == 6 and "error: " not in text:
            self.faults.append(f"shard {process.shard} ended with 6 and no message")

    def run_with_kills(self, budget):
        """All shards, one of them twice in most rounds; some are killed in the middle. Returns the kills."""
        processes = [self.start(shard) for shard in range(1, SHARDS + 1)]
        processes += self.double(0.7)
        # In most rounds a process is killed early; a slow disk makes the middle later.
        span = 0.6 + 0.05 * self.delay_ms
        kills = sorted((self.rng.uniform(0.02, span), process) for process in processes
                       if self.rng.random() < 0.8)[:budget]
        begin, done = time.monotonic(), 0
        for at, process in kills:
            time.sleep(max(0.0, begin + at - time.monotonic()))
            if process.poll() is None:
                process.send_signal(self.rng.choice([signal.SIGKILL] * 4 + [signal.SIGTERM, signal.SIGINT]))
                process.disturbed = "killed"
                done += 1
        self.wait(processes)
        return done

    def double(self, chance):
        """A shard that another process works on already, as a list of one or none."""
        if self.rng.random() >= chance:
            return []
        with self.torture.mutex:
            self.torture.counts["doubled"] += 1
        return [self.start(self.rng.randint(1, SHARDS))]

    def run_with_faults(self, budget):
        """All shards, each with one operation (or all from one on) that fails. Returns the faults."""
        processes = []
        for shard in range(1, SHARDS + 1):
            environment = {"FAIL_AT": str(self.rng.randint(1, 400)),
                           "FAIL_ERRNO": str(self.rng.choice(ERRORS)),
                           "FAIL_ON": str(self.rng.randint(0, 1)),
                           "FAIL_MARK": str(self.folder / f"failed_{shard}")}
            processes.append(self.start(shard, environment if shard <= budget else None))
        processes += self.double(0.3)
        self.wait(processes)
        return len(list(self.folder.glob("failed_*")))  # some ended before their operation came

    def wait(self, processes):
        for process in processes:
            try:
                process.wait(timeout=900)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                self.faults.append(f"shard {process.shard} hung")
                continue
            self.check(process)

    def finish(self):
        """Starts shards again, at the same time, until each has ended with 0; then compares."""
        self.delay_ms = min(self.delay_ms, 2)
        missing = set(range(1, SHARDS + 1))
        for _ in range(20):
            processes = [self.start(shard) for shard in sorted(missing)]
            self.wait(processes)
            missing = {process.shard for process in processes if process.returncode != 0}
            if not missing:
                break
        else:
            self.faults.append(f"shards {sorted(missing)} did not end")
        self.compare()

    def compare(self):
        expected, found = self.torture.expected, files_of(self.dataset)
        differing = [name for name in expected & found
                     if not filecmp.cmp(self.torture.reference / name, self.dataset / name, shallow=False)]
        for what, names in (("lost", expected - found), ("left over", found - expected),
                            ("different", differing)):
            if names:
                self.faults.append(f"{len(names)} files {what}, such as {min(names)}")


class Torture:
    def __init__(self, options):
        self.options = options
        self.program = options.build / "bin/diorama"
        self.library = options.build / "tests/unkind_files.so"
        for file in (self.program, self.library):
            if not file.exists():
                sys.exit(f"torture: no {file}; build with tests first")
        self.work = pathlib.Path(tempfile.mkdtemp(prefix="diorama-torture."))
        self.mutex = threading.Lock()  # of the counts
        self.begin = time.monotonic()
        self.counts = collections.Counter()
        self.reference = self.work / "reference"
        subprocess.run([self.program, "run", HERE / "job.yaml", "--output", self.reference, *self.smaller()],
                       check=True, capture_output=True)
        self.expected = files_of(self.reference)

    def smaller(self):
        return ["--set", f"total_captures={self.options.captures}"]

    def run(self):
        counts, options = self.counts, self.options
        ended = threading.Event()
        talker = threading.Thread(target=self.tell_progress, args=(ended,), daemon=True)
        talker.start()
        with concurrent.futures.ThreadPoolExecutor(options.at_once) as pool:
            for future in [pool.submit(self.make_rounds) for _ in range(options.at_once)]:
                future.result()
        ended.set()
        print("torture: " + self.report(), flush=True)
        if not counts["bad"]:
            shutil.rmtree(self.work)
        missing = [what for what in ("kills", "faults") if getattr(options, what) and not counts[what]]
        if missing:
            print("torture: the time ended before any " + " and ".join(missing), flush=True)
        return 1 if counts["bad"] or missing else 0

    def make_rounds(self):
        """One after the other, until there is nothing more to do."""
        counts, options = self.counts, self.options
        while not (options.seconds and time.monotonic() - self.begin >= options.seconds):
            with self.mutex:
                wants_kills = counts["kills"] < options.kills
                if not wants_kills and counts["faults"] >= options.faults:
                    return
                left = {what: getattr(options, what) - counts[what] for what in ("kills", "faults")}
                counts["rounds"] += 1
                round_ = Round(self, counts["rounds"])
                counts[f"rounds at {round_.delay_ms} ms"] += 1
            if wants_kills:
                what, done = "kills", round_.run_with_kills(left["kills"])
            else:
                what, done = "faults", round_.run_with_faults(left["faults"])
            with self.mutex:
                counts[what] += done
            round_.finish()
            with self.mutex:
                for fault in round_.faults:
                    print(f"{round_.folder}: {fault}", flush=True)
                counts["bad"] += bool(round_.faults)
            if not round_.faults:
                shutil.rmtree(round_.folder)

    def tell_progress(self, ended):
        while not ended.wait(SAY_EVERY_S):
            print("so far: " + self.report(), flush=True)

    def report(self):
        counts = self.counts
        delays = ", ".join(f"{counts[f'rounds at {delay} ms']} at {delay} ms" for delay in sorted({*DELAYS_MS}))
        return (f"{counts['rounds']} rounds of {SHARDS} shards ({delays}; {counts['doubled']} with a shard twice), "
                f"{counts['kills']} kills, {counts['faults']} faults, {len(self.expected)} files each, "
                f"{counts['bad']} rounds with faults, {time.monotonic() - self.begin:.0f} s")


def files_of(folder):
    """Names of all files but the journal, whose parts may lie in another order."""
    names = set()
    for at, folders, files in os.walk(folder):
        if ".diorama" in folders:
            folders.remove(".diorama")
        names.update(os.path.relpath(os.path.join(at, name), folder) for name in files)
    return names


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--faults", type=int, default=0)
    parser.add_argument("--captures", type=int, default=16, help="of the job")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--seconds", type=float, help="until no further round begins (default: no limit)")
    parser.add_argument("--at-once", type=int, default=max(1, len(os.sched_getaffinity(0)) // 2),
                        help="rounds side by side, which wait for most of their time (default: %(default)s)")
    parser.add_argument("--build", type=pathlib.Path, default=HERE.parent.parent / "build/release")
    options = parser.parse_args()
    options.build = options.build.resolve()  # rounds are run elsewhere
    return Torture(options).run()


if __name__ == "__main__":
    sys.exit(main())
