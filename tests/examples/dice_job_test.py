# SPDX-License-Identifier: Apache-2.0
"""The job of examples/dice, small: pictures, labels, what lint says, and that all is the same from any number of threads.

    dice_job_test.py JOB DIORAMA PLUGIN_DIR DICE_PLUGIN_DIR
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

JOB, DIORAMA, PLUGIN_DIR, DICE_DIR = (os.path.abspath(name) for name in sys.argv[1:5])


def make(folder, *more):
    small = ["cameras.phone.width=160", "cameras.phone.height=160", "renderer.samples=1",
             "total_captures=4", "timeline.1.count=1", "writers.yolo.min_visible_px=4"]
    command = [DIORAMA, "--plugin-dir", PLUGIN_DIR, "--plugin-dir", DICE_DIR, "--log-level",
               "warning", *more, "run", JOB, "--output", folder]
    for assignment in small:
        command += ["--set", assignment]
    subprocess.run(command, check=True, stdin=subprocess.DEVNULL)
    return {str(f.relative_to(folder)): f.read_bytes()
            for f in sorted(pathlib.Path(folder).rglob("*")) if f.suffix in (".jpg", ".txt")}


class DiceJob(unittest.TestCase):
    def test_job(self):
        with tempfile.TemporaryDirectory() as folder:
            files = make(folder + "/one", "--threads", "1")
            again = make(folder + "/two", "--threads", "3")
            subprocess.run([DIORAMA, "--plugin-dir", PLUGIN_DIR, "lint", folder + "/one"], check=True,
                           stdout=subprocess.DEVNULL)
            names = pathlib.Path(folder + "/one/yolo/data.yaml").read_text()
        self.assertEqual(files, again)
        self.assertIn('names:\n  0: "1"\n', names)
        pictures = [f for f in files if f.endswith(".jpg")]
        self.assertEqual(len(pictures), 4)
        counts, classes = [], set()
        for picture in pictures:
            self.assertEqual(files[picture][:2], b"\xff\xd8")
            label = picture.replace("images", "labels").replace(".jpg", ".txt")
            lines = files[label].decode().splitlines()
            counts.append(len(lines))
            for line in lines:
                number, x, y, width, height = line.split()
                classes.add(int(number))
                for low, size in ((float(x) - float(width) / 2, float(width)),
                                  (float(y) - float(height) / 2, float(height))):
                    self.assertGreater(size, 0.01)
                    self.assertGreater(low, -1e-5)
                    self.assertLess(low + size, 1 + 1e-5)
        self.assertTrue(classes <= set(range(6)))
        self.assertGreaterEqual(len(classes), 4)
        self.assertTrue(all(count <= 32 for count in counts))
        self.assertGreater(max(counts), min(counts), "throws have different numbers of dice")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
