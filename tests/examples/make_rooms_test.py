# SPDX-License-Identifier: Apache-2.0
"""examples/infinigen/make_rooms.sh with a stand-in for Infinigen: arguments, resuming, failures, parallel
rooms, stopping, and the job at the end.

    make_rooms_test.py MAKE_ROOMS DIORAMA PLUGIN_DIR
"""
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

SCRIPT, DIORAMA, PLUGIN_DIR = (os.path.abspath(name) for name in sys.argv[1:4])
FAKE = pathlib.Path(__file__).parent / "fake_infinigen"

JOB = """
environments: {folders: [outputs/rooms/]}
capture: {total_captures: 2, num_floating_captures_per_env: 1, num_cameras: 1, resolution: [32, 24]}
writers: [{type: BasicWriter, kwargs: {output_dir: pictures, rgb: true}}]
labeled_assets: {auto_label: {num: 0}}
distractors: {shape_distractors: {num: 2}}
"""


SKIES = """Cloudy/champagne_castle_1 Cloudy/kloofendal_48d_partly_cloudy Clear/evening_road_01
Clear/mealie_road Clear/qwantani Clear/noon_grass Evening/evening_road_01 Night/kloppenheim_02
Night/moonlit_golf""".split()


def write_skies(root):
    """The tutorial's skies, each a flat grey of 4 x 2 pixels."""
    for name in SKIES:
        file = root / "NVIDIA/Assets/Skies" / (name + "_4k.hdr")
        file.parent.mkdir(parents=True, exist_ok=True)
        header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n"
        file.write_bytes(header + bytes([128, 128, 128, 129]) * 8)


class MakeRooms(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.common = tempfile.TemporaryDirectory()
        cls.room = os.path.join(cls.common.name, "room.usdc")
        cls.environment = {
            **os.environ,
            "DIORAMA": DIORAMA,
            "DIORAMA_PLUGIN_PATH": PLUGIN_DIR,
            "PYTHON": sys.executable,
            "PYTHONPATH": str(FAKE),
            "PYTHONDONTWRITEBYTECODE": "1",
            "FAKE_INFINIGEN_ROOM": cls.room,
        }
        subprocess.run(
            [DIORAMA, "export", "dining_room:3", cls.room], env=cls.environment, check=True
        )

    @classmethod
    def tearDownClass(cls):
        cls.common.cleanup()

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.place = pathlib.Path(self.folder.name)
        self.trace = self.place / "trace"
        self.trace.mkdir()

    def tearDown(self):
        self.folder.cleanup()

    def start(self, *arguments, **variables):
        environment = {**self.environment, "FAKE_INFINIGEN_TRACE": str(self.trace), **variables}
        return subprocess.Popen(
            ["bash", SCRIPT, *arguments],
            cwd=self.place,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def make(self, *arguments, **variables):
        process = self.start(*arguments, **variables)
        output, errors = process.communicate(timeout=120)
        return process.returncode, output, errors

    def usd(self, seed):
        return (
            self.place / f"outputs/rooms/dining_room_{seed}/export_scene.blend/export_scene.usdc"
        )

    def calls(self, step, seed):
        """How often a step was begun for a seed."""
        file = self.trace / f"{step}_{seed}"
        if not file.exists():
            return 0
        return sum(1 for line in file.read_text().splitlines() if not line.endswith(" end"))

    def test_every_seed_is_generated_exported_and_checked(self):
        code, output, errors = self.make("--first-seed", "4", "--count", "2")
        self.assertEqual(code, 0, errors)
        self.assertIn("2 of 2 rooms below outputs/rooms", output)
        for seed in (4, 5):
            self.assertTrue(self.usd(seed).is_file())
            inspected = (self.usd(seed).parents[1] / "inspect.txt").read_text()
            self.assertIn("TableDining", inspected)
        generate = (self.trace / "generate_5").read_text()
        for words in (
            "--seed 5 --task coarse --output_folder outputs/indoors/dining_room_5",
            "-g fast_solve.gin singleroom.gin",
            "compose_indoors.terrain_enabled=False",
            'restrict_solving.restrict_parent_rooms=["DiningRoom"]',
        ):
            self.assertIn(words, generate)
        export = (self.trace / "export_5").read_text()
        for words in ("-f usdc", "-r 1024", "--omniverse"):
            self.assertIn(words, export)

    def test_finished_rooms_and_steps_are_not_repeated(self):
        self.make("--count", "2")
        code, output, _ = self.make("--count", "3")
        self.assertEqual(code, 0)
        self.assertIn("3 of 3 rooms", output)
        self.assertEqual([self.calls("generate", seed) for seed in (1, 2, 3)], [1, 1, 1])
        self.assertEqual([self.calls("export", seed) for seed in (1, 2, 3)], [1, 1, 1])
        # A room whose export is gone is exported again, not generated again.
        (self.place / "outputs/rooms/dining_room_2/.exported").unlink()
        self.make("--count", "3")
        self.assertEqual(self.calls("generate", 2), 1)
        self.assertEqual(self.calls("export", 2), 2)

    def test_a_failing_seed_does_not_stop_the_others(self):
        code, output, errors = self.make("--count", "4", "--jobs", "2", FAKE_INFINIGEN_FAILING="2")
        self.assertEqual(code, 1)
        self.assertIn("3 of 4 rooms", output)
        self.assertIn("seed 2: generation failed, see outputs/logs/dining_room_2.log", errors)
        log = (self.place / "outputs/logs/dining_room_2.log").read_text()
        self.assertIn("the solver found no layout", log)
        code, output, _ = self.make("--count", "4")
        self.assertEqual(code, 0)
        self.assertEqual([self.calls("generate", seed) for seed in (1, 2, 3, 4)], [1, 2, 1, 1])

    def test_an_export_that_does_not_load_is_told_and_made_again(self):
        code, output, errors = self.make("--count", "2", FAKE_INFINIGEN_BROKEN="1")
        self.assertEqual(code, 1)
        self.assertIn("1 of 2 rooms", output)
        self.assertIn("does not load, see outputs/rooms/dining_room_1/inspect.txt", errors)
        code, _, _ = self.make("--count", "2")
        self.assertEqual(code, 0)
        self.assertEqual([self.calls("generate", 1), self.calls("export", 1)], [1, 2])

    def test_rooms_are_made_side_by_side_but_never_more_than_asked_for(self):
        code, _, errors = self.make("--count", "5", "--jobs", "2", FAKE_INFINIGEN_SECONDS="0.5")
        self.assertEqual(code, 0, errors)
        times = []
        for seed in range(1, 6):
            begin, end = (self.trace / f"generate_{seed}").read_text().splitlines()
            times.append((float(begin.split()[0]), 1))
            times.append((float(end.split()[0]), -1))
        running = most = 0
        for _, change in sorted(times):
            running += change
            most = max(most, running)
        self.assertEqual(most, 2)

    def test_stopping_the_script_stops_infinigen_and_it_can_go_on(self):
        process = self.start("--count", "2", "--jobs", "2", FAKE_INFINIGEN_SECONDS="30")
        deadline = time.monotonic() + 60
        while self.calls("generate", 1) + self.calls("generate", 2) < 2:
            self.assertLess(time.monotonic(), deadline, "the rooms were never begun")
            time.sleep(0.05)
        process.send_signal(signal.SIGTERM)
        # The pipes close only when Infinigen, which holds them, has ended, too.
        _, errors = process.communicate(timeout=20)
        self.assertEqual(process.returncode, 130)
        self.assertIn("run it again to go on", errors)
        self.assertFalse(self.usd(1).exists())
        code, _, _ = self.make("--count", "2")
        self.assertEqual(code, 0)

    def test_the_job_runs_on_the_folder_as_it_is(self):
        (self.place / "job.yaml").write_text(JOB)
        write_skies(self.place / "root")
        code, _, errors = self.make(
            "--count", "2", "--run", "job.yaml", DIORAMA_ASSETS_ROOT=str(self.place / "root")
        )
        self.assertEqual(code, 0, errors)
        self.assertEqual(len(list((self.place / "pictures").rglob("rgb_*.png"))), 2)

    def test_mistakes_are_told_before_anything_is_made(self):
        for arguments, message in (
            (["--cout", "2"], "unknown option '--cout'"),
            (["--count", "many"], "--count expects a whole number, found 'many'"),
            (["--jobs", "0"], "must be at least 1"),
            (["--run", "nothing.yaml"], "'nothing.yaml' is no file"),
        ):
            code, _, errors = self.make(*arguments)
            self.assertEqual(code, 2)
            self.assertIn(message, errors)
        code, _, errors = self.make(PYTHON="no-such-python")
        self.assertEqual(code, 1)
        self.assertIn("'no-such-python' not found", errors)
        self.assertFalse((self.place / "outputs").exists())


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
