# SPDX-License-Identifier: Apache-2.0
"""The package "diorama" on a dataset of every writer: python_test.py PROGRAM JOB"""
import gc
import json
import multiprocessing
import pathlib
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import unittest

try:
    import cv2
    import h5py
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)
import diorama

PROGRAM, JOB = sys.argv[1:3]
FOLDERS = ["basic", "bop", "coco", "hdf5", "image_folder", "kitti", "pose", "voc", "webdataset", "yolo"]
run = None


def setUpModule():
    global run, temporary
    temporary = tempfile.TemporaryDirectory()
    run = pathlib.Path(temporary.name) / "run"
    subprocess.run([PROGRAM, "--log-level", "error", "run", JOB, "--output", run], check=True, capture_output=True)


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
                   tuple(a["bbox"]), a["area"]) for a in written["annotations"]}
        made = dataset.to_coco()
        names = {category["id"]: category["name"] for category in made["categories"]}
        ours = {(pathlib.Path(made["images"][a["image_id"] - 1]["file_name"]).stem, names[a["category_id"]],
                 tuple(a["bbox"]), a["area"]) for a in made["annotations"]}
        self.assertTrue(theirs)
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
            with self.assertRaises(IndexError):
                dataset[place]

    def test_errors(self):
        for folder, text in [(run / "nowhere", "not a folder"), (run, "holds several datasets")]:
            with self.assertRaisesRegex(diorama.Error, text) as caught:
                diorama.open(folder)
            self.assertEqual(caught.exception.kind, "usage")
        with self.assertRaises(diorama.Error):
            diorama.open(run / "coco", reader="CocoReeder")

    def test_damage_is_a_finding(self):
        copy = pathlib.Path(temporary.name) / "damaged"
        subprocess.run(["cp", "-r", run / "basic", copy], check=True)
        next(copy.rglob("rp_cam_0/rgb/*0003.png")).write_bytes(b"no picture")
        findings = diorama.open(copy)[3].findings
        self.assertTrue(any("0003.png" in finding.file for finding in findings), findings)


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

    def test_pickled(self):
        again = pickle.loads(pickle.dumps(diorama.open(run / "basic", wanted=["color"])))
        self.assertEqual(set(again[0].frames[0].channels), {"color"})


class Run(unittest.TestCase):
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

        def fail(capture):
            raise KeyError("mine")

        with self.assertRaisesRegex(KeyError, "mine"):
            diorama.run(JOB, fail)

    def test_ctrl_c(self):
        def interrupt(capture):
            signal.raise_signal(signal.SIGINT)

        with self.assertRaises(KeyboardInterrupt):
            diorama.run(JOB, interrupt)

    def test_one_at_a_time(self):
        def again(capture):
            diorama.run(JOB, print)

        with self.assertRaisesRegex(diorama.Error, "at work already"):
            diorama.run(JOB, again)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
