# SPDX-License-Identifier: Apache-2.0
"""The package "diorama" on a dataset of every writer: python_test.py PROGRAM JOB"""
import ast
import dataclasses
import enum
import gc
import json
import multiprocessing
import os
import pathlib
import pickle
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import types
import unittest

try:
    import cv2
    import h5py
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)
import diorama
import diorama.plugins

PROGRAM, JOB = sys.argv[1:3]
FOLDERS = ["basic", "bop", "coco", "hdf5", "image_folder", "kitti", "pose", "voc", "webdataset", "yolo"]
run = None


def setUpModule():
    global run, temporary
    temporary = tempfile.TemporaryDirectory()
    run = pathlib.Path(temporary.name) / "run"
    subprocess.run([PROGRAM, "--log-level", "error", "run", JOB, "--output", run, "--set", "writers.3.crowd_below_px=30"],
                   check=True, capture_output=True)


def tearDownModule():
    temporary.cleanup()


class Open(unittest.TestCase):
    def test_every_format_of_a_run(self):
        found = diorama.find(run)
        self.assertEqual({pathlib.Path(folder).name for folder in found}, {*FOLDERS, "visualization"})
        for name in FOLDERS:
            with self.subTest(name):
                dataset = diorama.open(run / name)
                self.assertEqual((len(dataset), dataset.cameras), (24, ["cam_0", "cam_1"]))
                self.assertEqual(dataset.findings, [])
                capture = dataset[-1]
                self.assertEqual((capture.index, len(capture.frames), capture.findings), (23, 2, []))
                self.assertEqual(capture.frames[1].channels["color"].shape, (48, 64, 4))

    def test_pixels_are_those_that_opencv_reads(self):
        frame = diorama.open(run / "basic")[7].frames[1]
        picture, = (run / "basic").rglob("rp_cam_1/rgb/*0007.png")
        theirs = cv2.imread(str(picture), cv2.IMREAD_UNCHANGED)[:, :, [2, 1, 0]]
        np.testing.assert_array_equal(frame.channels["color"][:, :, :3], theirs)

    def test_values_are_those_that_h5py_reads(self):
        capture = diorama.open(run / "hdf5")[5]
        for frame in capture.frames:
            file, = (run / "hdf5").rglob(f"000005_{frame.camera_name}.hdf5")
            with h5py.File(file) as stored:
                depth = stored["depth"][()]
                np.testing.assert_array_equal(frame.channels["color"][:, :, :3], stored["colors"][()])
                np.testing.assert_array_equal(frame.camera.matrix, stored["cam_K"][()])
                np.testing.assert_array_equal(frame.world_from_camera, stored["world_from_camera"][()])
                self.assertEqual(set(np.unique(frame.channels["instance_id"])), set(np.unique(stored["instance_segmaps"][()])))
            seen = frame.channels["instance_id"] > 0
            np.testing.assert_array_equal(frame.channels["distance_to_image_plane"][seen], depth[seen])

    def test_labels(self):
        dataset = diorama.open(run / "coco")
        written = json.loads(next((run / "coco").rglob("instances*.json")).read_text())
        pictures = {image["id"]: image for image in written["images"]}
        classes = {category["id"]: category["name"] for category in written["categories"]}
        theirs = {(pathlib.Path(pictures[a["image_id"]]["file_name"]).stem, classes[a["category_id"]],
                   tuple(a["bbox"]), a["area"], a["iscrowd"]) for a in written["annotations"]}
        made = dataset.to_coco()
        names = {category["id"]: category["name"] for category in made["categories"]}
        ours = {(pathlib.Path(made["images"][a["image_id"] - 1]["file_name"]).stem, names[a["category_id"]],
                 tuple(a["bbox"]), a["area"], a["iscrowd"]) for a in made["annotations"]}
        self.assertEqual({a["iscrowd"] for a in written["annotations"]}, {0, 1})
        self.assertLessEqual(theirs, ours)  # ours has those of both splits
        for annotation in made["annotations"]:
            counts = annotation["segmentation"]["counts"]
            self.assertEqual(sum(counts[1::2]), annotation["area"])
            self.assertEqual(sum(counts), 48 * 64)

    def test_geometry(self):
        frame = diorama.open(run / "hdf5")[0].frames[0]
        depth = frame.channels["distance_to_image_plane"]
        checked = 0
        for instance in frame.instances:
            low, high = instance.bounds
            for y, x in np.argwhere(frame.mask(instance))[::7]:
                ray = np.linalg.inv(frame.camera.matrix) @ [x + 0.5, y + 0.5, 1.0]
                point = np.array([*(ray * depth[y, x] * [1, -1, -1]), 1.0])
                inside = (np.linalg.inv(instance.world_from_object) @ frame.world_from_camera @ point)[:3]
                self.assertTrue((inside >= low - 1e-3).all() and (inside <= high + 1e-3).all(), (instance.path, inside))
                checked += 1
        self.assertGreater(checked, 5)

    def test_views_outlive_what_they_came_from_and_cannot_be_written(self):
        color = diorama.open(run / "basic")[2].frames[0].channels["color"]
        before = color.sum()
        gc.collect()
        for other in diorama.open(run / "basic"):
            pass
        self.assertEqual(color.sum(), before)
        self.assertIsNotNone(color.base)
        with self.assertRaises(ValueError):
            color[0, 0, 0] = 1

    def test_boxes_come_from_ids_where_there_are_no_others(self):
        boxes = diorama.open(run / "basic")
        without = pathlib.Path(temporary.name) / "without"
        shutil.copytree(run / "basic", without, ignore=shutil.ignore_patterns("bounding_box_2d_*"))
        ids = diorama.open(without)
        self.assertNotIn("tight_boxes", ids.holds)
        seen = 0
        for i in (0, 7):
            for ours, theirs in zip(ids[i].frames, boxes[i].frames):
                expected = {each.id: each.box for each in theirs.instances if each.box}
                self.assertEqual({each.id: each.box for each in ours.instances if each.box}, expected)
                seen += len(expected)
        self.assertGreater(seen, 0)
        self.assertEqual(len(ids.to_coco()["annotations"]), len(boxes.to_coco()["annotations"]))

    def test_only_what_is_wanted(self):
        dataset = diorama.open(run / "basic", wanted=["distance_to_image_plane"])
        self.assertEqual(set(dataset[0].frames[0].channels), {"distance_to_image_plane"})
        with self.assertRaisesRegex(diorama.Error, "does not hold colour; it holds .*color"):
            diorama.open(run / "basic", wanted=["colour"])

    def test_as_a_sequence(self):
        dataset = diorama.open(run / "voc")
        self.assertEqual([capture.index for capture in dataset[20:]], [20, 21, 22, 23])
        self.assertEqual([capture.index for capture in dataset], list(range(24)))
        for place in (24, -25):
            with self.assertRaisesRegex(IndexError, "there is no capture at place -?[0-9]+ of [0-9]+"):
                dataset[place]

    def test_errors(self):
        for folder, text in [(run / "nowhere", "not a folder"), (run, "holds several datasets")]:
            with self.assertRaisesRegex(diorama.Error, text) as caught:
                diorama.open(folder)
            self.assertEqual(caught.exception.kind, "usage")
        with self.assertRaises(diorama.Error):
            diorama.open(run / "coco", reader="CocoReeder")
        broken = pathlib.Path(temporary.name) / "broken"
        (broken / "annotations").mkdir(parents=True)
        (broken / "annotations/instances_train.json").write_text('{"images": [{"id": 1')
        with self.assertRaisesRegex(diorama.Error, "no annotation file of COCO that can be read: annotations/instances_train.json: "):
            diorama.open(broken)

    def test_texts_that_are_no_utf8(self):
        folder = pathlib.Path(temporary.name) / os.fsdecode(b"caf\xe9")
        folder.mkdir()
        for name in ("images/train", "labels/train"):
            (folder / name).mkdir(parents=True)
        (folder / "images/train" / os.fsdecode(b"\xfc.png")).write_bytes(cv2.imencode(".png", np.zeros((8, 8, 3), np.uint8))[1].tobytes())
        (folder / "labels/train" / os.fsdecode(b"\xfc.txt")).write_text("0 0.5 0.5 0.5 0.5\n")
        (folder / "data.yaml").write_text("path: .\ntrain: images/train\nval: images/train\nnames:\n  0: cup\n")
        dataset = diorama.open(folder)
        self.assertEqual((len(dataset), dataset.folder), (1, str(folder)))
        self.assertEqual(dataset[0].frames[0].instances[0].labels, {"class": "cup"})
        self.assertEqual(list(diorama.find(folder)), [str(folder)])
        self.assertEqual(len(pickle.loads(pickle.dumps(dataset))), 1)
        (folder / "labels/train" / os.fsdecode(b"\xfc.txt")).write_text("nothing\n")
        finding, *_ = diorama.open(folder)[0].findings
        self.assertTrue(finding.file.endswith(os.fsdecode(b"\xfc.txt")), finding)

    def test_arguments_are_looked_at_first(self):
        for wrong, words in [(lambda: diorama.open(run / "coco", wanted="color"), r"a list of names, \['color'\]"),
                             (lambda: diorama.run(JOB, print, wanted="color"), r"a list of names"),
                             (lambda: diorama.run(JOB, None), "on_capture is a function"), (lambda: diorama.run(JOB, [1]), "on_capture is a function")]:
            with self.assertRaisesRegex(TypeError, words):
                wrong()
        def yields(capture):
            yield capture

        async def waits(capture):
            pass

        for wrong, words in [(lambda: diorama.open(run / "coco", wanted=["color", 3]), r"a list of names, not \['color', 3\]"),
                             (lambda: diorama.open(run / "coco", wanted=7), "a list of names, not 7"),
                             (lambda: diorama.open(run / "coco", reader=["CocoReader"]), r"reader is a type or a mapping.*not \['CocoReader'\]"),
                             (lambda: diorama.open(None), "not NoneType"),
                             (lambda: diorama.run(JOB, yields), "has yield or is async"), (lambda: diorama.run(JOB, waits), "has yield or is async"),
                             (lambda: diorama.run("", print), "job is the name of a file.*not ''"), (lambda: diorama.run([JOB], print), "job is the name of a file"),
                             (lambda: diorama.run(JOB, print, settings=["seed=3"]), r"settings are values by their names.*not \['seed=3'\]"),
                             (lambda: diorama.run(JOB, print, settings={"seed": {3}}), r"settings\['seed'\]: a job has texts, numbers.*not \{3\}"),
                             (lambda: diorama.run({"seed": 3, "cameras": [{"width": 8}, {"width": {8}}]}, print), r"job\['cameras'\]\[1\]\['width'\]: a job has .*not \{8\}"),
                             (lambda: diorama.run(JOB, print, threads="2"), "'str' object cannot be interpreted as an integer"),
                             (lambda: diorama.run(JOB, print, seed=1.5), "'float' object cannot be interpreted as an integer")]:
            with self.assertRaisesRegex(TypeError, words):
                wrong()
        for arguments in ({"threads": -1}, {"seed": -1}, {"seed": 2**64}):
            with self.assertRaisesRegex(diorama.Error, "threads are 0 or more, a seed is from 0"):
                diorama.run(JOB, print, **arguments)

    def test_things_are_themselves(self):
        """They have arrays, which are neither equal nor different."""
        first, again = diorama.open(run / "basic")[0], diorama.open(run / "basic")[0]
        self.assertNotEqual(first, again)
        for frame, other in zip(first.frames, again.frames):
            self.assertEqual(len({*frame.instances, *other.instances}), 2 * len(frame.instances))
            for place, instance in enumerate(frame.instances):
                self.assertEqual(frame.instances.index(instance), place)
                self.assertNotIn(instance, other.instances)
            self.assertEqual(frame.camera, other.camera)

    def test_damage_is_a_finding(self):
        copy = pathlib.Path(temporary.name) / "damaged"
        subprocess.run(["cp", "-r", run / "basic", copy], check=True)
        next(copy.rglob("rp_cam_0/rgb/*0003.png")).write_bytes(b"no picture")
        findings = diorama.open(copy)[3].findings
        self.assertTrue(any("0003.png" in finding.file for finding in findings), findings)

    def test_masks_that_overlap(self):
        folder = pathlib.Path(temporary.name) / "overlaps"
        (folder / "annotations").mkdir(parents=True)
        (folder / "images").mkdir()
        cv2.imwrite(str(folder / "images/a.png"), np.full((20, 30, 3), 90, np.uint8))
        corners = [(1, 2, 9, 10), (5, 5, 13, 13)]
        (folder / "annotations/instances_train.json").write_text(json.dumps({
            "images": [{"id": 1, "file_name": "a.png", "width": 30, "height": 20}], "categories": [{"id": 1, "name": "box"}],
            "annotations": [{"id": i, "image_id": 1, "category_id": 1, "bbox": [a, b, c - a, d - b], "iscrowd": i,
                             "segmentation": [[a, b, c, b, c, d, a, d]]}
                            for i, (a, b, c, d) in enumerate(corners)]}))
        dataset = diorama.open(folder)
        frame = dataset[0].frames[0]
        self.assertNotIn("instance_id", frame.channels)
        for instance, (a, b, c, d) in zip(frame.instances, corners):
            expected = np.zeros((20, 30), bool)
            expected[b:d, a:c] = True
            np.testing.assert_array_equal(frame.mask(instance), expected)
        self.assertEqual([(each["area"], each["iscrowd"]) for each in dataset.to_coco()["annotations"]], [(64, 0), (64, 1)])
        self.assertEqual([instance.labels for instance in frame.instances], [{"class": "box"}, {"class": "box", "iscrowd": "1"}])
        self.assertEqual(diorama.open(folder, wanted=["tight_boxes"])[0].frames[0].masks, {})


class Types(unittest.TestCase):
    def test_stubs_and_annotations(self):
        if shutil.which("mypy") is None:
            self.skipTest("mypy is not there")  # other versions than Debian 12's find other things
        package = pathlib.Path(diorama.__file__).parent
        cache = f"--cache-dir={temporary.name}/mypy"
        checked = subprocess.run(["mypy", "--strict", cache, package], capture_output=True, text=True)
        self.assertEqual(checked.returncode, 0, checked.stdout)
        # What pybind11 makes is a bit different from what a stub can say; what collections.abc is, mypy knows itself.
        settings = pathlib.Path(temporary.name) / "allowed"
        settings.write_text("diorama\\.(plugins\\.)?(Callable|Iterable|Iterator|Mapping|Sequence)\\b.*\n"
                            "diorama\\.(_diorama|plugins)\\.(Files|Node|OpenDataset|Rng|Scene)\n"
                            "diorama\\.(_diorama|plugins)\\.\\w+\\.__(init|eq|hash|repr)__\n")
        checked = subprocess.run(["stubtest", "--concise", "--ignore-unused-allowlist", "--allowlist", settings, "diorama"], capture_output=True, text=True,
                                 cwd=temporary.name, env={**os.environ, "MYPYPATH": str(package.parent)})
        self.assertEqual(checked.returncode, 0, checked.stdout + checked.stderr)

    def test_everything_is_documented(self):
        for module in (diorama, diorama.plugins):
            for name in module.__all__:
                each = getattr(module, name)
                if not callable(each) or isinstance(each, types.GenericAlias):
                    continue
                self.assertTrue(each.__doc__ and not each.__doc__.startswith(name + "("), name)
                if not isinstance(each, type):
                    continue
                if dataclasses.is_dataclass(each):
                    for field in dataclasses.fields(each):
                        self.assertIn(f"`{field.name}`", each.__doc__, name)
                for key, member in vars(each).items():
                    if not key.startswith("_") and (callable(member) or isinstance(member, property)) and not isinstance(member, enum.Enum):
                        first, _, rest = (member.__doc__ or "").partition("\n")
                        self.assertTrue((rest if "(self: " in first else first + rest).strip(), f"{name}.{key}")  # pybind11 begins with the signature

    def test_stubs_say_what_the_module_says(self):
        """People read the one in an editor, the other by help()."""
        stub = ast.parse((pathlib.Path(diorama.__file__).parent / "_diorama.pyi").read_text())
        native = diorama._diorama
        told = 0
        for cls in (each for each in stub.body if isinstance(each, ast.ClassDef)):
            pairs = [(ast.get_docstring(cls), getattr(native, cls.name).__doc__)]
            pairs += [(ast.get_docstring(each), getattr(getattr(native, cls.name), each.name).__doc__) for each in cls.body if isinstance(each, ast.FunctionDef)]
            for ours, theirs in pairs:
                if ours and cls.name != "Error":
                    told += 1
                    self.assertIn(" ".join(ours.split()), " ".join((theirs or "").split()))
        self.assertGreater(told, 15)


def sum_in_another_process(dataset, place):
    return int(dataset[place].frames[0].channels["color"].sum())


class Workers(unittest.TestCase):
    def setUp(self):
        self.dataset = diorama.open(run / "webdataset")
        self.expected = [sum_in_another_process(self.dataset, i) for i in range(8)]

    def test_processes(self):
        for method in ("fork", "spawn"):
            with self.subTest(method), multiprocessing.get_context(method).Pool(2) as pool:
                tasks = [pool.apply_async(sum_in_another_process, (self.dataset, i)) for i in range(8)]
                self.assertEqual([task.get(60) for task in tasks], self.expected)

    def test_a_fork_that_inherits(self):
        context = multiprocessing.get_context("fork")
        queue = context.Queue()
        child = context.Process(target=lambda: queue.put(sum_in_another_process(self.dataset, 3)))
        child.start()
        self.assertEqual(queue.get(timeout=60), self.expected[3])
        child.join()

    def test_threads(self):
        sums = [0] * 8

        def read(i):
            sums[i] = sum_in_another_process(self.dataset, i)

        threads = [threading.Thread(target=read, args=(i,)) for i in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(sums, self.expected)

    def test_threads_that_open(self):
        lengths = []

        def opened(name):
            lengths.append((name, len(diorama.open(run / name)), len(diorama.find(run))))

        threads = [threading.Thread(target=opened, args=(name,)) for name in FOLDERS]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(sorted(lengths), [(name, 24, len(FOLDERS) + 1) for name in FOLDERS])

    def test_processes_that_are_elsewhere(self):
        """Names of files that are relative hold for where they were given."""
        here = os.getcwd()
        os.chdir(run)
        try:
            dataset = diorama.open("webdataset")
        finally:
            os.chdir(here)
        for method in ("fork", "spawn"):
            with self.subTest(method), multiprocessing.get_context(method).Pool(1) as pool:
                self.assertEqual(pool.apply(sum_in_another_process, (dataset, 3)), self.expected[3])

    def test_pickled(self):
        again = pickle.loads(pickle.dumps(diorama.open(run / "basic", wanted=["color"])))
        self.assertEqual(set(again[0].frames[0].channels), {"color"})


class Moving(unittest.TestCase):
    """What stands beside the pixels of frames that were made: clips, velocities, keypoints, joints."""

    def made(self, job, **arguments):
        seen = []
        diorama.run(job, seen.append, **arguments)
        return seen

    def test_a_clip(self):
        folder = pathlib.Path(temporary.name)
        (folder / "box.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
        (folder / "box.keypoints.yaml").write_text("keypoints: {tip: [0, 0, 1]}\n")
        job = {"seed": 3, "total_captures": 4, "environments": [{"type": "shapes", "shapes": ["cube"]}],
               "objects": [{"type": "files", "name": "boxes", "files": [str(folder / "box.obj")], "under": "/Assets", "label": "box",
                            "keypoints": ["tip"], "gravity_disabled_chance": 0.0}],
               "cameras": [{"type": "pinhole", "name": "cam", "width": 40, "height": 30, "position": [6, 0, 4], "look_at": [0, 0, 3]}],
               "randomizers": [{"type": "scatter_poses", "name": "poses", "on": ["environment"], "nodes": "/Assets/*", "offset": [0, 0, [3, 4]]}],
               "renderer": {"type": "null"}, "timeline": [{"record": {"fps": 10, "seconds": 0.4}}],
               "writers": [{"type": "BasicWriter", "name": "basic", "rgb": True, "instance_segmentation": True, "camera_params": True,
                            "colorize_instance_segmentation": False, "bounding_box_3d": True, "velocities": True, "channels": ["flow_forward"]}]}
        seen = self.made(job, wanted=["color", "instances", "flow_forward", "flow_forward_state"])
        self.assertEqual([(c.clip.clip, c.clip.frame, c.clip.frame_count, c.clip.fps) for c in seen], [(0, i, 4, 10.0) for i in range(4)])
        self.assertAlmostEqual(seen[3].clip.time_s, 0.3)
        boxes = [capture.frames[0].instances[-1] for capture in seen]
        self.assertEqual(len({box.id for box in boxes}), 1)
        for before, box, capture in zip(boxes, boxes[1:], seen):
            fallen = before.world_from_object[2, 3] - box.world_from_object[2, 3]
            self.assertAlmostEqual(fallen, -0.05 * (before.velocity.linear + box.velocity.linear)[2], delta=0.01)
            flow = capture.frames[0].channels["flow_forward"]
            state = capture.frames[0].channels["flow_forward_state"]
            self.assertEqual((flow.dtype, flow.shape, state.shape), (np.float32, (30, 40, 2), (30, 40)))
            self.assertLessEqual(set(np.unique(state)), {int(each) for each in diorama.FlowState})
        point, = boxes[0].keypoints_world.values()
        np.testing.assert_allclose(point, (boxes[0].world_from_object @ [0, 0, 1, 1])[:3])
        np.testing.assert_allclose(boxes[0].keypoints["tip"], [0, 0, 1], atol=1e-12)

        (folder / "clip.json").write_text(json.dumps(job))
        subprocess.run([PROGRAM, "--log-level", "error", "run", folder / "clip.json", "--output", folder / "clip"], check=True, capture_output=True)
        stored = diorama.open(folder / "clip")
        self.assertLessEqual({"clips", "velocities"}, set(stored.holds))
        for ours, theirs, box in zip(seen, stored, boxes):
            self.assertEqual(ours.clip, theirs.clip)
            velocity, = (i.velocity for i in theirs.frames[0].instances if i.path == box.path)
            np.testing.assert_allclose(velocity.linear, box.velocity.linear, atol=1e-5)
            np.testing.assert_array_equal(theirs.frames[0].channels["flow_forward"], ours.frames[0].channels["flow_forward"])

    def test_joints(self):
        cabinet = pathlib.Path(__file__).resolve().parents[3] / "examples/articulated/cabinet.usda"
        job = {"total_captures": 1, "environments": [{"type": "shapes", "shapes": ["cube"]}], "physics": {"type": "none"},
               "objects": [{"type": "files", "name": "chest", "files": [str(cabinet)], "under": "/Assets", "label": "cabinet", "collider": "none"}],
               "cameras": [{"type": "pinhole", "name": "cam", "width": 8, "height": 6}], "renderer": {"type": "null"},
               "randomizers": [{"type": "joint_states", "name": "open", "on": ["environment"], "joints": ["/Assets/**"], "moved_chance": 1.0}],
               "timeline": [{"capture": "still", "count": 1}]}
        frame = self.made(job)[0].frames[0]
        moved = [joint for joint in frame.joints if joint.kind != "fixed"]
        self.assertGreaterEqual({joint.kind for joint in moved}, {"prismatic"})
        for joint in moved:
            self.assertTrue(joint.lower <= joint.position <= joint.upper and joint.position != 0.0, joint)
            self.assertTrue(joint.path.startswith("/Assets/") and joint.child_path.startswith("/Assets/"), joint)


class Memory(unittest.TestCase):
    def test_views_live_as_long_as_anything_refers_to_them(self):
        dataset = diorama.open(run / "basic")
        expected = [dataset[i].frames[0].channels["color"].copy() for i in range(8)]
        kept = []
        threshold = gc.get_threshold()
        gc.set_threshold(1)
        try:
            for i in range(8):
                channels = dataset[i].frames[0].channels
                kept.append(channels["color"][3:, ::2].reshape(-1, 4).view(np.uint32))  # a view of a copy, and of the pixels:
                kept.append(channels["color"][1:][::2])
                del channels
                gc.collect()
        finally:
            gc.set_threshold(*threshold)
        del dataset
        gc.collect()
        for color, part in zip(expected, kept[1::2]):
            np.testing.assert_array_equal(part, color[1:][::2])

    def test_nothing_is_left_behind(self):
        def resident_kb():
            lines = pathlib.Path("/proc/self/status").read_text().splitlines()
            return int(next(line.split()[1] for line in lines if line.startswith("VmRSS")))

        dataset = diorama.open(run / "basic")
        for capture in dataset:
            pass
        gc.collect()
        before = resident_kb()
        for _ in range(12):
            for capture in dataset:
                pass
        self.assertLess(resident_kb() - before, 20_000)

    def test_the_run_waits_for_whoever_is_slow(self):
        code = """if True:
            import resource, time, diorama
            job = {"total_captures": 160, "environments": [{"type": "shapes", "shapes": ["cube"]}], "physics": {"type": "none"},
                   "cameras": [{"type": "pinhole", "name": "cam", "width": 1280, "height": 960}], "renderer": {"type": "null"},
                   "timeline": [{"capture": "still", "count": 160}]}
            began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            def slow(capture):
                time.sleep(1.5)
                return False
            diorama.run(job, slow, wanted=["color", "normals", "position"])
            print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - began)
        """
        told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        self.assertLess(int(told.stdout), 700_000, "kB; all captures would take 5.5 GB")


class Run(unittest.TestCase):
    def test_threads_of_python_go_on(self):
        beats = []
        done = threading.Event()

        def beat():
            while not done.wait(0.001):
                beats.append(len(seen))

        seen = []
        other = threading.Thread(target=beat)
        other.start()
        diorama.run(JOB, seen.append)
        done.set()
        other.join()
        self.assertGreater(len(set(beats)), 1)

    def test_the_pixels_and_labels_of_a_dataset(self):
        seen = []
        diorama.run(JOB, seen.append, wanted=["color", "instance_id", "instances", "normals"], threads=3)
        self.assertEqual([capture.index for capture in seen], list(range(24)))
        stored = diorama.open(run / "hdf5")
        for ours, theirs in zip(seen, stored):
            for frame, other in zip(ours.frames, theirs.frames):
                np.testing.assert_array_equal(frame.channels["color"], other.channels["color"])
                np.testing.assert_allclose(frame.world_from_camera, other.world_from_camera, atol=1e-6)
                boxes = {instance.path: instance.box for instance in frame.instances if instance.box}
                self.assertEqual(boxes, {instance.path: instance.box for instance in other.instances if instance.box})
        self.assertEqual(set(seen[0].frames[0].channels), {"color", "instance_id", "normals"})

    def test_a_dictionary_with_settings(self):
        job = {"seed": 3, "total_captures": 6, "environments": [{"type": "shapes", "shapes": ["cube"]}],
               "cameras": [{"type": "pinhole", "name": "cam", "width": 32, "height": 24}], "physics": {"type": "none"},
               "renderer": {"type": "null"}, "timeline": [{"capture": "floating", "count": 2}]}
        sizes = []
        diorama.run(job, lambda capture: sizes.append(capture.frames[0].channels["color"].shape),
                    settings={"cameras[0].width": 40})
        self.assertEqual(sizes, [(24, 40, 4)] * 6)
        label = "tasse \U0001f375 \u7897"
        folder = pathlib.Path(temporary.name) / "caf\xe9"
        folder.mkdir(exist_ok=True)
        (folder / "box.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
        labelled = []
        diorama.run({**job, "total_captures": np.int64(2), "objects": (
            {"type": "files", "name": "boxes", "files": [folder / "box.obj"], "under": "/Assets", "label": label},)},
            lambda capture: labelled.append(capture.frames[0].instances[-1].labels), settings={"cameras[0].position": np.array([0.0, 0.0, 5.0])})
        self.assertEqual(labelled, [{"class": label}] * 2)
        with self.assertRaisesRegex(diorama.Error, "renderer: unknown renderer 'nul', did you mean 'null'") as caught:
            diorama.run({**job, "renderer": {"type": "nul"}}, print)
        self.assertIn(caught.exception.kind, ("config", "plugin"))
        with self.assertRaisesRegex(diorama.Error, "colour"):
            diorama.run(job, print, wanted=["colour"])

    def test_an_end_before_the_end(self):
        seen = []

        def take(capture):
            seen.append(capture.index)
            return len(seen) < 5

        diorama.run(JOB, take)
        self.assertEqual(seen, [0, 1, 2, 3, 4])

        for no in (False, np.bool_(False), np.zeros(()) > 0):
            seen.clear()
            diorama.run(JOB, lambda capture: (seen.append(capture.index), no)[1])
            self.assertEqual(seen, [0], repr(no))
        seen.clear()
        diorama.run(JOB, lambda capture: (seen.append(capture.index), np.float32(0) if capture.index < 3 else False)[1])
        self.assertEqual(seen, [0, 1, 2, 3])

        def fail(capture):
            raise KeyError("mine")

        with self.assertRaisesRegex(KeyError, "mine"):
            diorama.run(JOB, fail)

    def test_the_function_is_called_in_the_thread_that_waits(self):
        threads = set()
        diorama.run(JOB, lambda capture: threads.add(threading.get_ident()), threads=3)
        self.assertEqual(threads, {threading.get_ident()})
        other = threading.Thread(target=diorama.run, args=(JOB, lambda capture: threads.add(threading.get_ident())))
        other.start()
        other.join()
        self.assertEqual(threads, {threading.main_thread().ident, other.ident})

    def test_ctrl_c(self):
        seen = []

        def interrupt(capture):
            signal.raise_signal(signal.SIGINT)
            seen.append(capture)

        with self.assertRaises(KeyboardInterrupt):
            diorama.run(JOB, interrupt)
        self.assertEqual(seen, [], "the function itself is interrupted")
        diorama.run(JOB, lambda capture: seen.append(capture) or False)
        self.assertEqual(len(seen), 1)

    def test_ctrl_c_while_the_first_capture_is_made(self):
        code = """if True:
            import diorama
            job = {"total_captures": 4, "environments": [{"type": "shapes", "shapes": ["cube"]}], "physics": {"type": "none"},
                   "cameras": [{"type": "pinhole", "name": "cam", "width": 4000, "height": 3000}], "renderer": {"type": "null"},
                   "timeline": [{"capture": "still", "count": 4}]}
            try:
                print("begins", flush=True)
                diorama.run(job, lambda capture: None, wanted=["color", "normals", "position"])
            except KeyboardInterrupt:
                print("interrupted")
        """
        child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
        self.assertEqual(child.stdout.readline(), "begins\n")
        child.send_signal(signal.SIGINT)
        self.assertEqual(child.communicate(timeout=120)[0], "interrupted\n")
        self.assertEqual(child.returncode, 0)

    def test_one_at_a_time(self):
        def again(capture):
            diorama.run(JOB, print)

        with self.assertRaisesRegex(diorama.Error, "at work already"):
            diorama.run(JOB, again)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
