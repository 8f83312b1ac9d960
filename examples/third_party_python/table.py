# SPDX-License-Identifier: Apache-2.0
"""A format of one's own in Python, a writer and its reader; see README.md."""
import csv
import io

import numpy as np

from diorama.plugins import Camera, Capture, Frame, Instance, Reader, Stored, Writer, param

FIELDS = ["camera", "id", "label", "x_min", "y_min", "x_max", "y_max"]


class Table(Writer):
    """Pictures and the edges in them, and one line of text per object, for each capture."""

    needs = ["color", "edges", "instances"]
    taxonomy = param("class", "Labels to write.")

    def write(self, capture, files):
        lines = io.StringIO()
        table = csv.writer(lines, lineterminator="\n")
        table.writerow(FIELDS)
        for frame in capture.frames:
            for instance in frame.instances:
                if instance.box is not None:
                    table.writerow([frame.camera_name, instance.id, instance.labels.get(self.taxonomy, ""), *instance.box])
            pictures = io.BytesIO()
            np.savez_compressed(pictures, color=frame.channels["color"], edges=frame.channels["edges"])
            files.add(f"{capture.index:06d}_{frame.camera_name}.npz", pictures.getvalue())
        files.add(f"{capture.index:06d}.csv", lines.getvalue())
        files.record(",".join(frame.camera_name for frame in capture.frames))

    def finish(self, records, files):
        rows = []
        records(lambda capture, cameras: rows.append(f"{capture},{cameras}\n"))
        files.add("table.csv", "".join(rows))


class Tables(Reader):
    """Opens what Table writes: for `diorama lint`, `view`, `convert` and `diorama.open()`."""

    patterns = ["table.csv"]
    taxonomy = param("class", "What its labels are.")

    def open(self, folder):
        return OpenTable(folder, self.taxonomy)


class OpenTable(Stored):
    format = "table"
    holds = ["color", "edges", "instances", "labels", "tight_boxes"]

    def __init__(self, folder, taxonomy):
        self.folder = folder
        self.taxonomy = taxonomy
        rows = [line.split(",") for line in (folder / "table.csv").read_text().splitlines()]
        self.seen_by = {int(capture): cameras for capture, *cameras in rows}
        self.captures = sorted(self.seen_by)
        self.cameras = sorted({name for cameras in self.seen_by.values() for name in cameras})

    def read(self, place, wanted):
        index = self.captures[place]
        with open(self.folder / f"{index:06d}.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        frames = []
        for camera in self.seen_by[index]:
            pictures = np.load(self.folder / f"{index:06d}_{camera}.npz", allow_pickle=False)
            height, width = pictures["edges"].shape
            instances = [Instance(id=int(row["id"]), path=f"/{row['id']}", labels={self.taxonomy: row["label"]},
                                  box=tuple(int(row[key]) for key in FIELDS[3:]))
                         for row in rows if row["camera"] == camera]
            channels = {name: pictures[name] for name in ("color", "edges") if name in wanted}
            frames.append(Frame(camera, Camera(width, height), instances=instances, channels=channels))
        return Capture(index, frames=frames)
