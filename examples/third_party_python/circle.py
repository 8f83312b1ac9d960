# SPDX-License-Identifier: Apache-2.0
"""A randomizer and a writer in Python; see README.md."""
import csv
import io
import math

from diorama.plugins import Randomizer, Writer, param


class Circle(Randomizer):
    """Sets objects onto a circle, each turned about the vertical."""

    nodes = param("/Assets/*", "Objects to set down.")
    radius_m = param(0.5, "Of the circle, round the working area.", unit="m", least=0.0, most=100.0)
    height_m = param(0.0, "Above the working area.", unit="m")
    jitter_m = param(0.0, "Standard deviation of the radius.", unit="m", least=0.0)

    def randomize(self, scene, context, rng):
        nodes = scene.match(self.nodes)
        for i, node in enumerate(nodes):
            own = rng.fork(node.path)  # one more object leaves the draws of the others as they were
            radius = self.radius_m + own.normal(0.0, self.jitter_m)
            angle = 2.0 * math.pi * (i + own.uniform()) / len(nodes)
            node.position = context.working_area + [radius * math.cos(angle), radius * math.sin(angle), self.height_m]


class Table(Writer):
    """One line of text per object and picture, and all of them together in objects.csv."""

    needs = ["instances", "visibility"]
    taxonomy = param("class", "Labels to write.")

    def write(self, capture, files):
        lines = io.StringIO()
        table = csv.writer(lines, lineterminator="\n")
        for frame in capture.frames:
            for instance in frame.instances:
                if instance.box is not None:
                    table.writerow([capture.index, frame.camera_name, instance.labels.get(self.taxonomy, ""), *instance.box,
                                    instance.visibility.visible_pixels])
        files.add(f"{capture.index:06d}.csv", lines.getvalue())
        files.record(str(lines.getvalue().count("\n")))

    def finish(self, records, files):
        counts = []
        records(lambda capture, line: counts.append((capture, int(line))))
        files.add("objects.csv", "capture,objects\n" + "".join(f"{capture},{count}\n" for capture, count in counts))
