# SPDX-License-Identifier: Apache-2.0
"""Components in Python files, by the program: python_plugin_test.py PROGRAM SOURCE"""
import importlib.util
import json
import os
import pathlib
import py_compile
import subprocess
import sys
import tempfile
import unittest

import numpy as np

try:
    import jsonschema
except ImportError:
    jsonschema = None

PROGRAM, SOURCE = sys.argv[1], pathlib.Path(sys.argv[2])
EXAMPLE = SOURCE / "examples/third_party_python"

SCRIPT = '''
import numpy as np
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

class Settled(Move):
    height_m = 4.0
    def randomize(self, scene, context, rng):
        if self.height_m != 4.0:
            raise RuntimeError("the base class's value")

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

class Nearness(dp.Annotator):
    """Near things are bright.

    This is not shown."""
    needs = ["distance_to_image_plane"]
    provides = ["nearness"]
    reach_m = dp.param(1.0, "Distance at which it has fallen to 37 %.", unit="m", least=0.01, most=100.0)
    def annotate(self, frame, rng):
        if frame.instances or set(frame.channels) != set(self.needs):
            raise RuntimeError("it was given more than it needs")
        return {"nearness": np.exp(-frame.channels["distance_to_image_plane"] / np.float32(self.reach_m))}

class Noise(dp.Annotator):
    provides = ["noise"]
    def annotate(self, frame, rng):
        return {"noise": rng.generator().random((frame.camera.height, frame.camera.width), np.float32)}

class Doubles(Noise):
    def annotate(self, frame, rng):
        return {"noise": super().annotate(frame, rng)["noise"].astype(float)}

class Small(Noise):
    def annotate(self, frame, rng):
        return {"noise": super().annotate(frame, rng)["noise"][1:]}

class Less(Noise):
    def annotate(self, frame, rng):
        return {}

class Color(Noise):
    provides = ["color"]
    def annotate(self, frame, rng):
        return {"color": np.zeros((frame.camera.height, frame.camera.width), np.float32)}

class Nothing(Noise):
    provides = []

class Channels(dp.Writer):
    needs = ["nearness", "noise"]
    def write(self, capture, files):
        for frame in capture.frames:
            files.add(f"{capture.index}_{frame.camera_name}", b"".join(frame.channels[name].tobytes() for name in self.needs))

class NeedsNoise(Channels):
    needs = ["noise"]

class NeedsColor(Channels):
    needs = ["color"]

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
            "annotators=[{type: python, file: edges.py, class: Edges}]",
            "writers=[{type: python, name: table, file: table.py, class: Table}, {type: BasicWriter, name: basic, rgb: true}]",
            path=str(EXAMPLE))
        self.assertEqual(result.returncode, 0, result.stderr)
        files = self.files("out")
        self.assertEqual(files["table/table.csv"], b"0,cam_0,cam_1\n1,cam_0,cam_1\n2,cam_0,cam_1\n3,cam_0,cam_1\n")
        environment = {**os.environ, "DIORAMA_PYTHON_PATH": str(EXAMPLE)}
        lint = subprocess.run([PROGRAM, "lint", self.folder / "out"], capture_output=True, text=True, env=environment)
        self.assertEqual(lint.returncode, 0, lint.stdout + lint.stderr)
        self.assertIn("table: table", lint.stdout)

    def annotators(self, *names):
        return "annotators=[" + ", ".join(f"{{type: python, file: mine.py, class: {name}}}" for name in names) + "]"

    def test_annotators(self):
        sets = [self.annotators("Noise", "Nearness"), self.writer("Channels")]
        one = self.run_job(*sets, output="one", options=["--threads", "1"])
        self.assertEqual(one.returncode, 0, one.stderr)
        files = self.files("one")
        pictures = {name: np.frombuffer(content, np.float32) for name, content in files.items() if name.startswith("own/")}
        self.assertEqual(len(pictures), 8)
        self.assertEqual(len({content.tobytes() for content in pictures.values()}), 8)
        for values in pictures.values():
            near, noise = np.split(values, 2)
            self.assertTrue(near.size == 48 * 64 and 0.0 < near.max() < 1.0 and abs(noise.mean() - 0.5) < 0.05)
        three = self.run_job(*sets, output="three", options=["--threads", "3", "--visits-in-flight", "2"])
        self.assertEqual(three.returncode, 0, three.stderr)
        self.assertEqual(self.files("three"), files)

    def test_annotators_that_are_wrong(self):
        needs = self.writer("NeedsNoise")
        for name, code, words in [
            ("Doubles", 4, ["mine.py", "'noise'", "float64 (48, 64)", "float32 (48, 64)"]), ("Small", 4, ["mine.py", "float32 (47, 64)"]),
            ("Less", 4, ["mine.py", "gives the channels noise by name, not none"]), ("Nothing", 4, ["mine.py: Nothing provides nothing"]),
        ]:
            with self.subTest(name):
                self.check_refused(self.run_job(self.annotators(name), needs, output=name[:5]), code, *words)
        self.check_refused(self.run_job(self.annotators("Color"), self.writer("NeedsColor"), output="color"), 4, "'color'", "another type")
        self.check_refused(self.run_job(self.annotators("Noise", "Noise"), needs), 3, "annotators[1]", "makes 'noise'", "annotators[0]")
        self.check_refused(self.run_job(needs), 3, "needs 'noise'")

    def reader(self, body):
        (self.scripts / "reader.py").write_text(
            "import numpy as np\nfrom diorama.plugins import *\n\n\nclass Arrays(Reader):\n    patterns = ['*.npy']\n\n"
            "    def open(self, folder):\n        stored = Stored()\n        stored.__class__ = Opened\n        stored.folder = folder\n"
            "        stored.files = sorted(folder.glob('*.npy'))\n        stored.captures = range(len(stored.files))\n"
            "        stored.cameras, stored.holds = ['eye'], ['color', 'tight_boxes', 'instances', 'instance_id']\n        return stored\n\n\n"
            f"class Opened(Stored):\n    def read(self, place, wanted):\n        {body}\n")
        data = self.folder / "data"
        data.mkdir(exist_ok=True)
        for i in range(3):
            np.save(data / f"{i}.npy", np.full((4, 6, 4), 10 * i + 5, np.uint8))
        return data

    GOOD = ("color = np.load(self.files[place], allow_pickle=False); ids = np.zeros(color.shape[:2], np.uint32); ids[1:3, 2:5] = 7; "
            "return Capture(place, frames=[Frame('eye', Camera(color.shape[1], color.shape[0]), instances=[Instance(7, '/a', {'class': 'a'}, "
            "box=(2, 1, 5, 3))], channels={'color': color, 'instance_id': ids})])")

    def call(self, *arguments, path=None):
        environment = {**os.environ, "DIORAMA_PYTHON_PATH": str(self.scripts) if path is None else path}
        return subprocess.run([*arguments], capture_output=True, text=True, env=environment, cwd=self.folder, timeout=120)

    def test_a_reader(self):
        data = self.reader(self.GOOD)
        lint = self.call(PROGRAM, "lint", data)
        self.assertEqual(lint.returncode, 0, lint.stdout + lint.stderr)
        told = self.call(sys.executable, "-c", "import sys, diorama; d = diorama.open(sys.argv[1]); print(d, d.reader, d[2].frames[0].channels['color'].mean(), "
                         "d[1].frames[0].instances[0].box, len(d.to_coco()['annotations']))", data)
        self.assertEqual(told.stdout, f"<diorama.Dataset {data}: Arrays, 3 captures, 1 cameras> python 25.0 (2, 1, 5, 3) 3\n", told.stderr)
        made = self.call(PROGRAM, "convert", data, "--writer", "YoloWriter", "-o", "coco")
        self.assertEqual(made.returncode, 0, made.stdout + made.stderr)
        unknown = self.call(PROGRAM, "lint", data, path="")
        self.assertNotEqual(unknown.returncode, 0)

    def test_a_reader_has_parameters(self):
        data = self.reader(self.GOOD)
        file = self.scripts / "reader.py"
        file.write_text(file.read_text().replace("    patterns", "    label = param('a', 'Of all objects.')\n    every = param(1, 'Keeps one of so many.', least=1)\n    patterns")
                        .replace("range(len(stored.files))", "range(0, len(stored.files), self.every)\n        stored.label = self.label")
                        .replace("{'class': 'a'}", "{'class': self.label}").replace("Capture(place", "Capture(self.captures[place]"))
        named = "{type: python, file: reader.py, class: Arrays, params: {label: mug, every: 2}}"
        stats = self.call(PROGRAM, "stats", data, "--json", "--reader", named)
        self.assertEqual(stats.returncode, 0, stats.stderr)
        told = json.loads(stats.stdout)
        self.assertEqual((told["captures"], list(told["classes"])), (2, ["mug"]))
        opened = self.call(sys.executable, "-c", "import sys, diorama; d = diorama.open(sys.argv[1], reader={'type': 'python', 'file': 'reader.py', "
                           "'class': 'Arrays', 'params': {'label': 'cup'}}); print(len(d), d[0].frames[0].instances[0].labels)", data)
        self.assertEqual(opened.stdout, "3 {'class': 'cup'}\n", opened.stderr)
        for wrong, code, words in [
            (named.replace("every: 2", "every: 0"), 3, ["every", "at least 1"]), (named.replace("label", "lable"), 3, ["lable", "label"]),
            (named.replace("class: Arrays", "class: Arays"), 3, ["no reader 'Arays'", "Arrays"]), (named.replace("file: reader.py, ", ""), 3, ["file: expected"]),
            (named.replace("python", "phyton", 1), 2, ["python"]), ("{file: reader.py}", 2, ["--reader"]), ("{type: [", 3, ["--reader"]),
            ("{type: CocoReader, label: mug}", 3, ["label"]),
        ]:
            with self.subTest(wrong):
                self.check_refused(self.call(PROGRAM, "stats", data, "--reader", wrong), code, *words)
                for command in [("lint", data), ("diff", data, data), ("report", data, "-o", "page")]:
                    refused = self.call(PROGRAM, *command, "--reader", wrong)
                    self.assertEqual(refused.returncode, code, (command, refused.stdout, refused.stderr))
        described = self.call(PROGRAM, "plugins", "describe", "reader/python")
        for words in ("params of Arrays of reader.py", "params.every: integer, default 1", "Keeps one of so many."):
            self.assertIn(words, described.stdout)

    def test_readers_that_are_wrong(self):
        data = self.reader(self.GOOD)
        np.save(data / "1.npy", np.zeros((4, 6, 4), np.uint8))
        (data / "1.npy").write_bytes(b"no array")
        lint = self.call(PROGRAM, "lint", data)
        self.assertEqual(lint.returncode, 7, lint.stdout + lint.stderr)
        self.assertIn("reader.py:", lint.stdout + lint.stderr)
        for body, words in {
            "1 / 0": ["reader.py:", "ZeroDivisionError"],
            "return Capture(place + 1)": ["returns the diorama.Capture with index"],
            "return Capture(place, frames=[Frame('eye', Camera(6, 4), channels={'color': np.zeros((4, 6, 3), np.uint8)})])": ["uint8 (4, 6, 3)"],
            "return Capture(place, frames=[Frame('eye', Camera(0, 4))])": ["width and height"],
            "return Capture(place, frames=[Frame('eye', Camera(6, 4), masks={1: ((0, 0, 7, 1), np.ones((1, 7)))})])": ["a mask has a box in the image", "7"],
            "return Capture(place, frames=[Frame('eye', Camera(6, 4), masks={1: ((0, 0, 2, 1), np.ones((1, 3)))})])": ["a mask has the size of its box"],
        }.items():
            with self.subTest(body):
                lint = self.call(PROGRAM, "lint", self.reader(body))
                self.assertEqual(lint.returncode, 7, lint.stdout + lint.stderr)
                for word in [*words, "capture 2"]:
                    self.assertIn(word, lint.stdout)
                opened = self.call(sys.executable, "-c", "import sys, diorama; diorama.open(sys.argv[1])[2]", data)
                self.assertIn("diorama.Error: reader of Arrays, capture 2: ", opened.stderr)
        for body, words in {
            "Instance(7, '/a', {'class': 'a'}, box=(2, 1, 5.5, 3))": "Instance.box cannot be (2, 1, 5.5, 3)",
            "Instance(-1, '/a')": "Instance.id cannot be -1", "Instance(7, '/a', {'class': 7})": "Instance.labels cannot be {'class': 7}",
            "Instance(7, '/a', world_from_object=np.eye(3))": "Instance.world_from_object cannot be array(",
        }.items():
            with self.subTest(body):
                lint = self.call(PROGRAM, "lint", self.reader(f"return Capture(place, frames=[Frame('eye', Camera(6, 4), instances=[{body}])])"))
                self.assertIn(words, lint.stdout)
        once = self.reader("if place == 1: 1 / 0\n        " + self.GOOD)
        lint = self.call(PROGRAM, "lint", once)
        self.assertEqual(lint.stdout.count("ZeroDivisionError"), 1, lint.stdout + lint.stderr)
        stats = self.call(PROGRAM, "stats", once, "--json")
        self.assertEqual(stats.returncode, 0, stats.stderr)
        self.assertEqual((json.loads(stats.stdout)["pictures"], json.loads(stats.stdout)["findings"]), (2, 1))
        self.check_refused(self.call(PROGRAM, "convert", once, "--writer", "YoloWriter", "-o", "lost"), 5, "ZeroDivisionError", "capture 1")
        self.assertEqual(self.call(PROGRAM, "diff", once, once).returncode, 1)
        (self.scripts / "twin.py").write_text((self.scripts / "reader.py").read_text())
        self.check_refused(self.call(PROGRAM, "lint", data), 2, "several classes", "reader.py: Arrays", "twin.py: Arrays")
        (self.scripts / "twin.py").write_text("from diorama.plugins import Reader\n1 / 0\n")
        told = self.call(PROGRAM, "lint", self.reader(self.GOOD))
        self.assertEqual(told.returncode, 0, told.stderr)
        self.assertIn("twin.py:2: ZeroDivisionError", told.stderr)

    def test_a_reader_that_fails_leaves_the_others(self):
        data = self.reader(self.GOOD)
        for body, words in {"def recognise(self, folder):\n        return 1 / 0": "wrong.py:7: ZeroDivisionError", "patterns = '*.npy'": "X.patterns is a list of texts"}.items():
            with self.subTest(body):
                (self.scripts / "wrong.py").write_text("from diorama.plugins import *\n\n\nclass X(Reader):\n    patterns = ['*.npy']\n    " + body + "\n    def open(self, folder): pass\n")
                lint = self.call(PROGRAM, "lint", data)
                self.assertEqual(lint.returncode, 0, lint.stdout + lint.stderr)
                self.assertIn(words, lint.stderr)
                self.assertIn("(the reader is left out)", lint.stderr)

    def test_parameters_are_in_the_schema(self):
        told = self.call(PROGRAM, "plugins", "describe", "annotator/python")
        for words in ("params of Nearness of mine.py", "Near things are bright.", "params.reach_m: number, default 1 m, 0.01 to 100"):
            self.assertIn(words, told.stdout)
        self.assertNotIn("This is not shown", told.stdout)
        written = self.call(PROGRAM, "config", SOURCE / "configs/smoke.yaml", "--set", self.randomizer("Move", "height_m: 2"))
        self.assertEqual(written.returncode, 0, written.stderr)
        for words in ("height_m: 2", "mode: up", "times: 1"):
            self.assertIn(words, written.stdout)
        if jsonschema is None:
            self.skipTest("python3-jsonschema is not there")
        schema = json.loads(self.call(PROGRAM, "schema").stdout)
        jsonschema.Draft202012Validator.check_schema(schema)
        validator = jsonschema.Draft202012Validator(schema)

        def fits(params, name="Move", file="mine.py"):
            return validator.is_valid({"environments": [{"type": "shapes"}], "randomizers": [
                {"type": "python", "name": "move", "on": ["environment"], "file": file, "class": name, "params": params}]})

        for params in ({}, {"height_m": 5.0, "times": 2, "mode": "down", "offset": [1, 2, 3], "names": ["x"], "flag": True}):
            self.assertTrue(fits(params), params)
        for params in ({"heigth_m": 1}, {"height_m": 9}, {"times": 1.5}, {"mode": "left"}, {"offset": [1, 2]}, {"names": 7}, {"flag": "maybe"}, 3):
            self.assertFalse(fits(params), params)
        self.assertTrue(fits({"anything": 1}, file="elsewhere.py"))
        self.assertFalse(fits({"height_m": 1.0}, name="Divides"))

    def test_in_a_process_of_python(self):
        code = ("import sys, diorama; seen = []; sets = {'total_captures': 8, 'randomizers.poses': {'type': 'python', 'name': 'poses', 'on': ['environment'], "
                "'file': 'mine.py', 'class': sys.argv[2]}}\n"
                "try: diorama.run(sys.argv[1], seen.append, settings=sets, threads=3)\n"
                "except diorama.Error as error: print(error.kind, error)\n"
                "print([c.index for c in seen])")
        job = str(SOURCE / "configs/smoke.yaml")
        told = self.call(sys.executable, "-c", code, job, "Move")
        self.assertEqual(told.stdout, "[0, 1, 2, 3, 4, 5, 6, 7]\n", told.stderr)
        failed = self.call(sys.executable, "-c", code, job, "Divides")
        self.assertRegex(failed.stdout, r"plugin .*mine\.py:\d+: ZeroDivisionError")

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
        self.check_refused(self.run_job(self.randomizer("Move")), 3, "everybody may write to", "mine.py")
        (self.scripts / "mine.py").chmod(0o644)
        self.scripts.chmod(0o777)
        self.check_refused(self.run_job(self.randomizer("Move")), 3, "is not run", f"everybody may write to {self.scripts.resolve()}, ")
        self.scripts.chmod(0o755)
        self.assertEqual(self.run_job(self.randomizer("Move")).returncode, 0)

    def test_compiled_files_beside_a_script_are_not_run(self):
        script = self.scripts / "mine.py"
        planted = self.folder / "planted.py"
        planted.write_text("raise SystemExit('planted')\n")
        py_compile.compile(str(planted), importlib.util.cache_from_source(str(script)),
                           invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH)
        result = self.run_job(self.randomizer("Move"))
        self.assertEqual(result.returncode, 0, result.stderr)

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
        self.assertEqual(self.run_job(self.randomizer("Settled"), output="settled").returncode, 0)
        self.check_refused(self.run_job(self.randomizer("Settled", "height_m: 2"), output="settled"), 3, "height_m")

    def script(self, body, kind="Randomizer", head=""):
        """A class X of a file of its own, in which the mark "# here" stands in the line that messages are to name."""
        (self.scripts / "x.py").write_text(f"import numpy as np\nimport diorama.plugins as dp\n{head}\n\nclass X(dp.{kind}):\n    {body}\n")
        lines = (self.scripts / "x.py").read_text().splitlines()
        return next((i + 1 for i, line in enumerate(lines) if "# here" in line), None)

    def test_whatever_is_wrong_is_said_with_file_and_line(self):
        act = "def randomize(self, scene, context, rng):\n        "
        write = "needs = ['color']\n    def write(self, capture, files):\n        "
        annotate = "provides = ['noise']\n    def annotate(self, frame, rng):\n        "
        node = "scene.match('/Assets/*')[0]"
        cases = [
            # What Python throws.
            ("Randomizer", act + "raise ValueError('bad \\udcff text')  # here", ["ValueError: bad \\udcff text"]),
            ("Randomizer", act + "raise type('E', (Exception,), {'__str__': lambda self: 1 / 0})()  # here", ["E: (its own text fails)"]),
            ("Randomizer", act + "raise KeyboardInterrupt  # here", ["KeyboardInterrupt"]),
            ("Randomizer", "def __init__(self):\n        1 / 0  # here\n    " + act + "pass", ["ZeroDivisionError"]),
            ("Randomizer", act + "import nowhere  # here", ["ModuleNotFoundError: No module named 'nowhere'"]),
            ("Writer", write + "1 / 0  # here", ["ZeroDivisionError"]),
            ("Writer", write + "pass\n    def begin(self, dataset, files):\n        1 / 0  # here", ["ZeroDivisionError"]),
            ("Writer", write + "pass\n    def finish(self, records, files):\n        1 / 0  # here", ["ZeroDivisionError"]),
            ("Annotator", annotate + "1 / 0  # here", ["ZeroDivisionError"]),
            # Classes that cannot be used.
            ("Randomizer", act.replace("rng", "rng, more") + "pass", ["x.py:6", "X.randomize is called as randomize(self, scene, context, rng)"]),
            ("Randomizer", "def __init__(self, size): pass", ["x.py:6", "X.__init__ is called as __init__(self)"]),
            ("Randomizer", "pass", ["x.py:5", "X has no method randomize(self, scene, context, rng)"]),
            ("Writer", "pass", ["x.py:5", "X has no method write(self, capture, files)"]),
            ("Writer", write.replace("['color']", "'color'") + "pass", ["x.py:5", "X.needs is a list of texts, not 'color'"]),
            ("Annotator", annotate.replace("['noise']", "7") + "pass", ["x.py:5", "X.provides is a list of texts, not 7"]),
            # Declarations.
            ("Randomizer", "n = dp.param(2**40, 'Large.')  # here\n    " + act + "pass", ["32 bits"]),
            ("Randomizer", "n = dp.param(None, 'None.')  # here\n    " + act + "pass", ["a parameter is a bool, int", "not None"]),
            ("Randomizer", "n = dp.param(1.0, None)  # here\n    " + act + "pass", ["are texts"]),
            ("Randomizer", "n = dp.param(9.0, 'Far.', most=1.0)  # here\n    " + act + "pass", ["the default 9.0 is not from -inf to 1.0"]),
            ("Randomizer", "n = dp.param((0.0, 9.0, 0.0), 'Far.', most=1.0)  # here\n    " + act + "pass", ["the default 9.0"]),
            ("Randomizer", "n = dp.param(float('nan'), 'None.')  # here\n    " + act + "pass", ["the default nan"]),
            ("Randomizer", "n = dp.param('c', 'Word.', choices=['a', 'b'])  # here\n    " + act + "pass", ["'c' is none of the choices a, b"]),
            ("Randomizer", "n = dp.param('c', 'Word.', choices=[1, 2])  # here\n    " + act + "pass", ["are texts"]),
            # Values of wrong types.
            ("Randomizer", act + node + ".position = [0, 0]  # here", ["a position is three numbers, metres, found [0, 0]"]),
            ("Randomizer", act + node + ".world_from_node = np.eye(3)  # here", ["a pose is a matrix of 4 x 4 numbers, found array("]),
            ("Randomizer", act + node + ".labels = {'class': 7}  # here", ["labels are texts by texts", "found {'class': 7}"]),
            ("Randomizer", act + node + ".set_base_color('red')  # here", ["a colour is three numbers, found 'red'"]),
            ("Randomizer", act + node + ".positon = [0, 0, 0]  # here", ["no attribute 'positon'"]),
        ]
        for i, (kind, body, words) in enumerate(cases):
            with self.subTest(body):
                line = self.script(body, kind)
                sets = {"Randomizer": [self.randomizer("X", file="x.py")], "Writer": [self.writer("X", file="x.py")],
                        "Annotator": ["annotators=[{type: python, file: x.py, class: X}]", self.writer("NeedsNoise")]}[kind]
                result = self.run_job(*sets, output=f"wrong{i}")
                self.check_refused(result, 4, *([f"x.py:{line}: "] if line else []), *words)
                for word in ("Unable to cast", "incompatible function arguments", "unexpected error"):
                    self.assertNotIn(word, result.stderr)
        # Files that are no text of Python.
        for content, words in {b"x = 'caf\xe9'\n": ["SyntaxError", "utf-8"], b"x = 1\0\n": ["null bytes"]}.items():
            (self.scripts / "x.py").write_bytes(b"import diorama.plugins as dp\n" + content)
            self.check_refused(self.run_job(self.randomizer("X", file="x.py"), output="bytes"), 4, "x.py", *words)

    def test_a_run_that_fails_says_where_its_dataset_is(self):
        self.script("needs = ['color']\n    def write(self, capture, files):\n        files.add(f'{capture.index}.txt', b'')\n"
                    "        if capture.index == 3: raise OSError(28, 'No space left')", "Writer")
        sets = ["total_captures=8", self.writer("X", file="x.py")]
        failed = self.run_job(*sets, options=["--threads", "1", "--visits-in-flight", "1"])
        place = self.folder / "out"
        self.check_refused(failed, 4, f"dataset: {place}\n", f"next: the same command with --resume, diorama view {place}", "No space left")
        self.script("needs = ['color']\n    def write(self, capture, files):\n        files.add(f'{capture.index}.txt', b'')", "Writer")
        self.assertEqual(self.run_job(*sets, options=["--resume"]).returncode, 0)
        early = self.run_job(self.randomizer("Mov"), output="early")
        self.assertNotIn("dataset:", early.stderr)
        self.check_refused(self.run_job("randomizers.poses={type: python, name: poses, on: [environment]}", output="none"), 3, "file: expected a Python file")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
