# SPDX-License-Identifier: Apache-2.0
"""Datasets of Diorama, and of any other program whose format one of its readers knows.

    import diorama
    dataset = diorama.open("dataset/basic")
    for capture in dataset:
        for frame in capture.frames:
            frame.channels["color"]      # numpy, height x width x 4
            frame.instances[0].labels    # {"class": "cup"}

Units are metres and pixels. Matrices are 4 x 4 and take column vectors: point_a = a_from_b @ point_b. The world
is right-handed with z up, cameras look along -z with y up. Boxes are (x_min, y_min, x_max, y_max), half open.
What a format does not hold is None or not there (`Dataset.holds`). Messages go to logging.getLogger("diorama").
"""
from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, overload

import numpy as np

from . import _diorama
from ._diorama import Error, __version__

__all__ = ["Camera", "Capture", "Dataset", "Error", "Finding", "Frame", "Instance", "Visibility", "find", "open",
           "run", "__version__"]

Box = tuple[int, int, int, int]


@dataclasses.dataclass(frozen=True)
class Camera:
    """Lens and picture size; `fx` to `cy` in pixels from the left and top edge."""

    width: int
    height: int
    lens: str  #: "pinhole", "opencv_pinhole" or "fisheye_polynomial"
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...]  #: k1 k2 p1 p2 k3 k4 k5 k6 of OpenCV
    fisheye_polynomial: tuple[float, ...]  #: angle = a + b r + c r^2 ..., r in pixels
    near_m: float
    far_m: float

    @property
    def matrix(self) -> np.ndarray:
        """3 x 3, for axes x right, y down, z forward as OpenCV has them."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclasses.dataclass(frozen=True)
class Visibility:
    """How much of an object one camera sees."""

    visible_pixels: int
    amodal_pixels: int  #: inside of the picture, were nothing in front
    outside_pixels: int  #: beside the picture
    occlusion: float | None  #: 1 - visible / amodal; None when nothing is inside
    truncation: float  #: share outside of the picture
    amodal_box: Box | None
    amodal_mask: tuple[Box, np.ndarray] | None  #: where it lies, and 0 or 1 per pixel of that


@dataclasses.dataclass(frozen=True)
class Instance:
    """An object in a picture. `id` is its value in the channel "instance_id"."""

    id: int
    path: str
    labels: dict[str, str]
    world_from_object: np.ndarray | None  #: 4 x 4
    bounds: tuple[np.ndarray, np.ndarray] | None  #: least and greatest corner in the object's own space, metres
    box: Box | None  #: of its visible pixels
    visibility: Visibility | None


@dataclasses.dataclass(frozen=True)
class Frame:
    """What one camera sees in one capture."""

    camera_name: str
    camera: Camera
    world_from_camera: np.ndarray | None  #: 4 x 4
    instances: list[Instance]
    occlusions: list[tuple[int, int, int]]  #: (front id, behind id, pixels)
    #: By name, height x width or height x width x parts: "color" (uint8, RGBA), "distance_to_image_plane" (float32,
    #: metres, infinite where nothing is), "normals" (float32, world), "instance_id" (uint32) ... Views that cannot
    #: be written to and keep the capture's pixels in memory: copy what you keep for long.
    channels: dict[str, np.ndarray]

    def mask(self, instance: Instance) -> np.ndarray:
        """True where the instance is seen, height x width. Needs the channel "instance_id"."""
        return self.channels["instance_id"] == instance.id


@dataclasses.dataclass(frozen=True)
class Finding:
    """Something in the files that cannot be right; see `diorama lint`."""

    check: str
    file: str
    capture: int | None
    camera: str
    object: str
    found: str
    expected: str


@dataclasses.dataclass(frozen=True)
class Capture:
    """One moment, seen by all cameras."""

    index: int  #: in the job that made it
    visit: int
    phase: str
    environment: str
    split: str  #: "train", "val" ...; empty when the format has none
    frames: list[Frame]
    findings: list[Finding]


def _frame(values: dict[str, Any]) -> Frame:
    camera = values.pop("camera")
    for key in ("distortion", "fisheye_polynomial"):
        camera[key] = tuple(camera[key])
    instances = []
    for instance in values.pop("instances"):
        seen = instance.pop("visibility")
        instances.append(Instance(**instance, visibility=seen and Visibility(**seen)))
    return Frame(camera=Camera(**camera), instances=instances, **values)


def _capture(values: dict[str, Any]) -> Capture:
    values["frames"] = [_frame(frame) for frame in values["frames"]]
    values["findings"] = [Finding(**finding) for finding in values["findings"]]
    return Capture(**values)


def _refused(kind: str, text: str) -> Error:
    error = Error(text)
    error.kind = kind
    return error


def _program() -> str:
    """The program of the same build, which knows where plugins are: in a build tree, beside the installed
    package, or on the PATH."""
    here = pathlib.Path(__file__).resolve()
    for level in (2, 4):
        program = here.parents[level] / "bin" / "diorama"
        if program.is_file():
            return str(program)
    found = shutil.which("diorama")
    if found is None:
        raise _refused("plugin", f"the program 'diorama' is neither near {here.parent} nor on the PATH; plugins are found from there")
    return str(pathlib.Path(found).resolve())


class Dataset(Sequence[Capture]):
    """A dataset that was opened: a sequence of captures, each read when it is asked for.

    It can be handed to other processes (`torch.utils.data.DataLoader` with workers): they open it anew.
    Several threads may read at once."""

    def __init__(self, folder: str | os.PathLike[str], reader: str = "", wanted: Iterable[str] | None = None) -> None:
        self._asked = (os.fspath(folder), reader)
        self._wanted = None if wanted is None else sorted(wanted)
        self._open()
        unknown = sorted(set(self._wanted or ()) - set(self.holds))
        if unknown:
            raise _refused("usage", f"{self.folder}: does not hold {', '.join(unknown)}; it holds {', '.join(self.holds)}")

    def _open(self) -> None:
        self._process = os.getpid()
        self._stored = _diorama.open_dataset(_program(), *self._asked)
        info = self._stored.info()
        self.folder: str = info["folder"]
        self.reader: str = info["reader"]  #: type of the component that reads it
        self.format: str = info["format"]
        self.holds: list[str] = info["holds"]  #: channels and labels that some frame has
        self.cameras: list[str] = info["cameras"]
        self.captures: list[int] = info["captures"]  #: `Capture.index` of each
        self.classes: list[str] = info["classes"]  #: the format's own list; may be empty
        #: What opening found.
        self.findings: list[Finding] = [Finding(**finding) for finding in info["findings"]]

    def __len__(self) -> int:
        return len(self.captures)

    @overload
    def __getitem__(self, place: int) -> Capture: ...
    @overload
    def __getitem__(self, place: slice) -> list[Capture]: ...
    def __getitem__(self, place):
        if isinstance(place, slice):
            return [self[i] for i in range(*place.indices(len(self)))]
        place = range(len(self))[place]  # negative ones count from the end; others raise IndexError
        if os.getpid() != self._process:
            self._open()  # after a fork the threads of readers are gone
        return _capture(self._stored.read(place, self._wanted))

    def __iter__(self) -> Iterator[Capture]:
        return (self[i] for i in range(len(self)))

    def __reduce__(self):
        return Dataset, (*self._asked, self._wanted)

    def __repr__(self) -> str:
        return f"<diorama.Dataset {self.folder}: {self.format}, {len(self)} captures, {len(self.cameras)} cameras>"

    def to_coco(self, taxonomy: str = "class") -> dict[str, Any]:
        """The boxes and masks of all frames as COCO's detection files have them; nothing is written. File names are
        `<capture>_<camera>.png`. Masks are uncompressed run lengths, present where "instance_id" is held. Reads every capture."""
        names = list(self.classes)
        images: list[dict[str, Any]] = []
        annotations: list[dict[str, Any]] = []
        for capture in self:
            for frame in capture.frames:
                image = {"id": len(images) + 1, "file_name": f"{capture.index:06d}_{frame.camera_name}.png",
                         "width": frame.camera.width, "height": frame.camera.height}
                images.append(image)
                for instance in frame.instances:
                    name = instance.labels.get(taxonomy)
                    if name is None or instance.box is None:
                        continue
                    if name not in names:
                        names.append(name)
                    x_min, y_min, x_max, y_max = instance.box
                    annotation = {"id": len(annotations) + 1, "image_id": image["id"],
                                  "category_id": names.index(name) + 1, "iscrowd": 0,
                                  "bbox": [x_min, y_min, x_max - x_min, y_max - y_min],
                                  "area": (x_max - x_min) * (y_max - y_min)}
                    if "instance_id" in frame.channels:
                        mask = frame.mask(instance)
                        annotation["area"] = int(mask.sum())
                        annotation["segmentation"] = _run_lengths(mask)
                    annotations.append(annotation)
        categories = [{"id": i + 1, "name": name} for i, name in enumerate(names)]
        return {"images": images, "annotations": annotations, "categories": categories}


def _run_lengths(mask: np.ndarray) -> dict[str, Any]:
    """COCO's: down the columns, beginning with a run of zeros."""
    flat = np.concatenate([[0], mask.T.ravel().astype(np.int8), [1 - int(mask[-1, -1])]])
    ends = np.flatnonzero(np.diff(flat))
    counts = np.diff(np.concatenate([[0], ends])).tolist()
    return {"size": list(mask.shape), "counts": counts}


def open(folder: str | os.PathLike[str], *, reader: str = "", wanted: Iterable[str] | None = None) -> Dataset:
    """Opens a dataset's folder, or a run's that holds one dataset.

    `reader` is the type of a reader for folders that none knows by itself. `wanted` names what is to be read of
    `Dataset.holds`; the rest is left out, which saves time. Raises Error when there is no dataset, or several."""
    return Dataset(folder, reader, wanted)


def find(folder: str | os.PathLike[str]) -> Mapping[str, str]:
    """The datasets of a run: folder to the reader's type."""
    return dict(_diorama.find_datasets(_program(), os.fspath(folder)))


def run(job: Mapping[str, Any] | str | os.PathLike[str], on_capture: Callable[[Capture], object], *,
        wanted: Iterable[str] = ("color", "instances", "instance_id"), settings: Mapping[str, Any] | None = None,
        seed: int | None = None, threads: int = 0) -> None:
    """Makes the captures of a job and hands each to `on_capture`, in their order, as soon as it is there; nothing is
    written to the disk. While the function works the next captures are made, until 256 MB of them wait.

    `job` is a file, or the same as a dictionary; its writers are not looked at. `wanted` names channels and the
    annotations "instances", "visibility", "amodal_mask" and "occlusion_order". `settings` overrides single values,
    {"renderer.samples": 16}. The same job and seed give the same pixels as `diorama run` writes, for any number of
    threads (0: all). The function ends the run by returning False or by an exception, which comes out here."""
    file, text = ("", json.dumps(job)) if isinstance(job, Mapping) else (os.fspath(job), "")
    sets = [f"{key}={json.dumps(value)}" for key, value in (settings or {}).items()]
    _diorama.listen(_program(), file, text, sets, seed, lambda values: on_capture(_capture(values)), sorted(set(wanted)),
                    threads)
