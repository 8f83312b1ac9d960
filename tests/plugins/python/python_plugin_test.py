# SPDX-License-Identifier: Apache-2.0
"""Components in Python files, by the program: python_plugin_test.py PROGRAM SOURCE"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAM, SOURCE = sys.argv[1], pathlib.Path(sys.argv[2])
EXAMPLE = SOURCE / "examples/third_party_python"

SCRIPT = '''
import diorama.plugins as dp

class Move(dp.Randomizer):
    nodes = dp.param("/Assets/*", "Nodes.")
    height_m = dp.param(1.0, "Height.", unit="m", least=0.0, most=5.0)
    times = dp.param(1, "Times.")
    mode = dp.param("up", "Where to.", choices=["up", "down"])
    offset = dp.param((0.0, 0.0, 0.0), "Offset.")
    names = dp.param(["a"], "Names.")
    flag = dp.param(False, "Flag.")
    def randomize(self, scene, context, rng):
        for node in scene.match(self.nodes):
            node.position = [rng.fork(node.path).uniform(-1, 1), rng.uniform(-1, 1), self.height_m]

class Keeps(Move):
    kept = None
    def randomize(self, scene, context, rng):
        if Keeps.kept is not None:
            Keeps.kept.path
        Keeps.kept = scene.root

class Divides(dp.Randomizer):
    def randomize(self, scene, context, rng):
        1 / 0

class Exits(dp.Randomizer):
    def randomize(self, scene, context, rng):
        raise SystemExit(0)

class Shears(dp.Randomizer):
    def randomize(self, scene, context, rng):
        scene.match("/Assets/*")[0].world_from_node = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]]

class Leaves(dp.Writer):
    needs = ["color"]
    def write(self, capture, files):
        files.add("../../escaped.txt", "x")

class Colors(dp.Writer):
    needs = ["color", "instances"]
    def begin(self, dataset, files):
        files.add("about.txt", f"{dataset.captures} {dataset.cameras}")
    def write(self, capture, files):
        color = capture.frames[0].channels["color"]
        files.add(f"{capture.index}.txt", f"{color.shape} {int(color.sum())} {len(capture.frames[0].instances)}")
'''


class Runs(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.temporary.name)
        self.scripts = self.folder / "scripts"
        self.scripts.mkdir()
        (self.scripts / "mine.py").write_text(SCRIPT)

    def tearDown(self):
        self.temporary.cleanup()

    def run_job(self, *sets, output="out", options=(), path=None):
        job = SOURCE / "configs/smoke.yaml"
        arguments = [PROGRAM, "run", job, "--output", self.folder / output, *options]
        for each in sets:
            arguments += ["--set", each]
        environment = {**os.environ, "DIORAMA_PYTHON_PATH": str(self.scripts) if path is None else path}
        return subprocess.run(arguments, capture_output=True, text=True, env=environment, cwd=self.folder, timeout=120)

    def randomizer(self, name, params="", file="mine.py"):
        return f"randomizers.poses={{type: python, name: poses, on: [environment], file: {file}, class: {name}, params: {{{params}}}}}"

    def writer(self, name, file="mine.py"):
        return f"writers=[{{type: python, name: own, file: {file}, class: {name}}}]"

    def files(self, output):
        root = self.folder / output
        return {str(f.relative_to(root)): f.read_bytes() for f in root.rglob("*")
                if f.is_file() and ".diorama" not in f.parts}

    def check_refused(self, result, code, *words):
        self.assertEqual(result.returncode, code, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def test_same_bytes_for_any_number_of_threads_and_shards(self):
        sets = [self.randomizer("Move", "height_m: 2.0"), self.writer("Colors")]
        one = self.run_job(*sets, output="one", options=["--threads", "1"])
        self.assertEqual(one.returncode, 0, one.stderr)
        expected = self.files("one")
        self.assertEqual(expected["own/about.txt"], b"4 ['cam_0', 'cam_1']")
        self.assertTrue(expected["own/3.txt"].startswith(b"(48, 64, 4) "))
        three = self.run_job(*sets, output="three", options=["--threads", "3", "--visits-in-flight", "2"])
        self.assertEqual(three.returncode, 0, three.stderr)
        self.assertEqual(self.files("three"), expected)
        for shard in ("1/2", "2/2"):
            part = self.run_job(*sets, output="shards", options=["--shard", shard])
            self.assertEqual(part.returncode, 0, part.stderr)
        self.assertEqual(self.files("shards"), expected)
        other = self.run_job(self.randomizer("Move", "height_m: 1.0"), self.writer("Colors"), output="other")
        self.assertEqual(other.returncode, 0, other.stderr)
        self.assertNotEqual(self.files("other")["own/3.txt"], expected["own/3.txt"])

    def test_example(self):
        result = self.run_job(
            "randomizers.poses={type: python, name: poses, on: [environment], file: circle.py, class: Circle, params: {radius_m: 0.4}}",
            "writers=[{type: python, name: table, file: circle.py, class: Table}]", path=str(EXAMPLE))
        self.assertEqual(result.returncode, 0, result.stderr)
        files = self.files("out")
        self.assertEqual(len(files["table/objects.csv"].splitlines()), 5)
        rows = [line.split(b",") for name, text in files.items() if name.startswith("table/0") for line in text.splitlines()]
        self.assertTrue(rows)
        counts = sum(int(line.split(b",")[1]) for line in files["table/objects.csv"].splitlines()[1:])
        self.assertEqual(counts, len(rows))

    def test_a_job_alone_runs_no_code(self):
        for path in ("", "/nowhere", str(self.folder / "other")):
            (self.folder / "other").mkdir(exist_ok=True)
            self.check_refused(self.run_job(self.randomizer("Move"), path=path), 3, "DIORAMA_PYTHON_PATH", "mine.py")
        evil = self.folder / "evil.py"
        evil.write_text(SCRIPT)
        for name in ("../evil.py", str(evil)):
            self.check_refused(self.run_job(self.randomizer("Move", file=name)), 3, "DIORAMA_PYTHON_PATH")
        (self.scripts / "link.py").symlink_to(evil)
        self.check_refused(self.run_job(self.randomizer("Move", file="link.py")), 3, "DIORAMA_PYTHON_PATH")
        (self.scripts / "mine.py").chmod(0o666)
        self.check_refused(self.run_job(self.randomizer("Move")), 3, "everybody may write it")

    def test_parameters_are_checked_by_their_declaration(self):
        for params, words in {
            "heigth_m: 1": ["heigth_m", "height_m"],
            "height_m: 9": ["height_m", "5"],
            "times: 1.5": ["times", "integer"],
            "mode: left": ["mode", "up", "down"],
            "offset: [1, 2]": ["offset"],
            "names: 7": ["names"],
            "flag: maybe": ["flag"],
        }.items():
            with self.subTest(params):
                self.check_refused(self.run_job(self.randomizer("Move", params)), 3, *words)
        fits = "height_m: 5, times: 2, mode: down, offset: [1, 2, 3], names: [x, y], flag: true"
        result = self.run_job(self.randomizer("Move", fits))
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_errors_say_where(self):
        line = SCRIPT.splitlines().index("        1 / 0") + 1
        self.check_refused(self.run_job(self.randomizer("Divides")), 4, f"mine.py:{line}: ZeroDivisionError: division by zero", "randomizer")
        self.check_refused(self.run_job(self.randomizer("Exits")), 4, "SystemExit")
        self.check_refused(self.run_job(self.randomizer("Shears")), 4, "mine.py:", "last row is 0 0 0 1")
        self.check_refused(self.run_job(self.randomizer("Keeps"), ), 4, "mine.py:", "for one call")
        self.check_refused(self.run_job(self.randomizer("Mov")), 3, "there is no randomizer 'Mov'", "Move")
        self.check_refused(self.run_job(self.randomizer("Colors")), 3, "there is no randomizer 'Colors'")
        self.check_refused(self.run_job(self.writer("Leaves"), output="leaves"), 4, "mine.py:", "..")
        (self.scripts / "broken.py").write_text("import diorama\n\ndef x(:\n")
        self.check_refused(self.run_job(self.randomizer("Move", file="broken.py")), 4, "broken.py:3: SyntaxError")
        self.assertFalse((self.folder / "escaped.txt").exists())
        self.check_refused(self.run_job("randomizers.poses={type: python, name: poses, on: [environment]}", output="none"), 3, "file: expected a Python file")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
