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
import enum
import inspect
import json
import operator
import os
import pathlib
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, overload

import numpy as np

from . import _diorama
from ._diorama import Error, __version__

__all__ = ["Camera", "Capture", "ClipFrame", "Dataset", "Error", "Finding", "FlowState", "Frame", "Instance", "JointState",
           "Velocity", "Visibility", "find", "open", "run", "__version__"]

Array = np.ndarray[Any, np.dtype[Any]]
Box = tuple[int, int, int, int]


@dataclasses.dataclass(frozen=True)
class Camera:
    """Lens and picture size.

    - `width`: pixels
    - `height`: pixels
    - `lens`: "pinhole", "opencv_pinhole" or "fisheye_polynomial"
    - `fx`, `fy`: focal lengths, pixels
    - `cx`, `cy`: principal point, pixels from the left and the top edge
    - `distortion`: k1 k2 p1 p2 k3 k4 k5 k6 of OpenCV
    - `fisheye_polynomial`: angle = a + b r + c r^2 ..., r in pixels
    - `near_m`, `far_m`: metres; nothing nearer or farther is seen"""

    width: int
    height: int
    lens: str = "pinhole"
    fx: float = 600.0
    fy: float = 600.0
    cx: float = 320.0
    cy: float = 240.0
    distortion: tuple[float, ...] = ()
    fisheye_polynomial: tuple[float, ...] = ()
    near_m: float = 0.25
    far_m: float = 1000.0

    @property
    def matrix(self) -> Array:
        """float64, 3 x 3, pixels: for axes x right, y down, z forward as OpenCV has them."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclasses.dataclass(frozen=True, eq=False)
class Visibility:
    """How much of an object one camera sees.

    - `visible_pixels`: that show it
    - `amodal_pixels`: inside of the picture, were nothing in front
    - `outside_pixels`: beside the picture
    - `occlusion`: 1 - visible / amodal; None when nothing is inside
    - `truncation`: share outside of the picture
    - `amodal_box`: of all of it, half open; may reach out of the picture
    - `amodal_mask`: where it lies, and 0 or 1 per pixel of that: uint8, height x width of the box"""

    visible_pixels: int
    amodal_pixels: int
    outside_pixels: int
    occlusion: float | None
    truncation: float
    amodal_box: Box | None
    amodal_mask: tuple[Box, Array] | None


class FlowState(enum.IntEnum):
    """What the other frame of a flow shows of the point in a pixel: values of "flow_forward_state" and
    "flow_backward_state".

    - `SEEN`: the point itself
    - `HIDDEN`: something in front of it
    - `OUTSIDE`: nothing: it is out of the picture, or too near or far
    - `UNKNOWN`: there is no such point (nothing was hit), or no such frame"""

    SEEN = 0
    HIDDEN = 1
    OUTSIDE = 2
    UNKNOWN = 3


@dataclasses.dataclass(frozen=True, eq=False)
class Velocity:
    """How an object's origin moves and how the object turns.

    - `linear`: float64, 3: m/s, world
    - `angular`: float64, 3: rad/s, world axes"""

    linear: Array
    angular: Array


@dataclasses.dataclass(frozen=True, eq=False)
class Instance:
    """An object in a picture. `id` is its value in the channel "instance_id"; in a clip the same object has the same
    id in all frames.

    - `id`: value in the channel "instance_id"
    - `path`: of its node in the scene; unique
    - `labels`: taxonomy to label: {"class": "mug"}
    - `world_from_object`: float64, 4 x 4, metres
    - `bounds`: least and greatest corner in the object's own space: float64, 3 each, metres
    - `box`: of its visible pixels; where a dataset has no boxes, found in "instance_id" when that is read
    - `visibility`: how much of it is seen, where that is held
    - `keypoints`: by name: float64, 3, metres in the object's own space. Only what is made has them, not what is
      read
    - `keypoints_px`: where "keypoints" are held: float64, count x 3: x to the right and y down from the picture's
      upper left corner in pixels, and 2 for seen, 1 for hidden, 0 for not told. In the order of the class's
      `Dataset.skeletons`
    - `velocity`: of rigid bodies, where "velocities" are held"""

    id: int
    path: str
    labels: dict[str, str] = dataclasses.field(default_factory=dict)
    world_from_object: Array | None = None
    bounds: tuple[Array, Array] | None = None
    box: Box | None = None
    visibility: Visibility | None = None
    keypoints: dict[str, Array] = dataclasses.field(default_factory=dict)
    keypoints_px: Array | None = None
    velocity: Velocity | None = None

    @property
    def keypoints_world(self) -> dict[str, Array]:
        """By name: float64, 3, metres in the world. Needs `world_from_object`."""
        if self.world_from_object is None:
            return {}
        return {name: self.world_from_object[:3, :3] @ point + self.world_from_object[:3, 3]
                for name, point in self.keypoints.items()}


@dataclasses.dataclass(frozen=True)
class JointState:
    """A joint of the scene at the moment of a capture.

    - `path`: of the joint in the scene
    - `kind`: "fixed", "revolute" or "prismatic"
    - `parent_path`, `child_path`: of the bodies that it joins
    - `position`: radians or metres; 0 when fixed
    - `lower`: least position; -inf: none
    - `upper`: greatest one; inf: none"""

    path: str
    kind: str
    parent_path: str
    child_path: str
    position: float
    lower: float
    upper: float


@dataclasses.dataclass(frozen=True, eq=False)
class Frame:
    """What one camera sees in one capture.

    Channels, each height x width or height x width x parts, of which a dataset or run has some:

    - "color": uint8 x 4, sRGB and alpha; "color_hdr": float32 x 3, linear radiance before `exposure`
    - "distance_to_image_plane", "distance_to_camera": float32, metres along the viewing axis or the ray, +inf where
      nothing was hit; "sensor_depth": float32, metres as a depth camera measures them, 0 where it measures nothing
    - "normals": float32 x 3, unit vectors in the world, 0 where nothing was hit; "position": float32 x 3, metres, world
    - "instance_id", "leaf_id": uint32, 0 where nothing is; see `instances` and `leaf_paths`
    - "object_coordinates": float32 x 3, place in the object's box from 0 to 1 (NOCS); "uv": float32 x 2; "albedo": float32 x 3
    - "motion", "flow_forward", "flow_backward": float32 x 2, pixels to the right and down, since the last step of
      physics, to the clip's next and its previous frame; "flow_forward_state", "flow_backward_state": uint32, `FlowState`

    They are views that cannot be written to and keep the capture's pixels in memory: copy what you keep for long.

    - `camera_name`: as in `Dataset.cameras`
    - `camera`: lens and size
    - `world_from_camera`: float64, 4 x 4, metres; the camera looks along -z, y is up
    - `instances`: objects, also those that are not seen
    - `occlusions`: (front id, behind id, pixels)
    - `joints`: of the whole scene, the same for all cameras
    - `leaf_paths`: of the ids in "leaf_id"
    - `exposure`: factor from "color_hdr" to what is seen
    - `channels`: see above
    - `masks`: where masks of a format overlap, so that "instance_id" cannot hold them: by `Instance.id` where each
      lies, and 0 or 1 per pixel of that, uint8, height x width of the box. Read with "instance_id", which is then
      not there"""

    camera_name: str
    camera: Camera
    world_from_camera: Array | None = None
    instances: list[Instance] = dataclasses.field(default_factory=list)
    occlusions: list[tuple[int, int, int]] = dataclasses.field(default_factory=list)
    joints: list[JointState] = dataclasses.field(default_factory=list)
    leaf_paths: dict[int, str] = dataclasses.field(default_factory=dict)
    exposure: float = 1.0
    channels: dict[str, Array] = dataclasses.field(default_factory=dict)
    masks: dict[int, tuple[Box, Array]] = dataclasses.field(default_factory=dict)

    def has_mask(self, instance: Instance) -> bool:
        """Whether mask() has what it needs."""
        return "instance_id" in self.channels or instance.id in self.masks

    def mask(self, instance: Instance) -> Array:
        """bool, height x width: where the instance is seen. Needs the channel "instance_id" or one of `masks`."""
        if "instance_id" in self.channels or instance.id not in self.masks:
            mask: Array = self.channels["instance_id"] == instance.id
            return mask
        (x_min, y_min, x_max, y_max), pixels = self.masks[instance.id]
        mask = np.zeros((self.camera.height, self.camera.width), dtype=bool)
        mask[y_min:y_max, x_min:x_max] = pixels != 0
        return mask


@dataclasses.dataclass(frozen=True)
class Finding:
    """Something in the files that cannot be right; see `diorama lint`.

    - `check`: the rule that is broken
    - `file`: relative to the dataset
    - `capture`: `Capture.index`
    - `camera`: its name
    - `object`: its path
    - `found`: what is there
    - `expected`: what would be right"""

    check: str
    file: str
    capture: int | None = None
    camera: str = ""
    object: str = ""
    found: str = ""
    expected: str = ""


@dataclasses.dataclass(frozen=True)
class ClipFrame:
    """The place of a capture in a clip: captures of one scene in which time goes on.

    - `clip`: from 0 in the whole job
    - `frame`: from 0 in the clip
    - `frame_count`: of the clip
    - `fps`: frames per second"""

    clip: int
    frame: int
    frame_count: int
    fps: float

    @property
    def time_s(self) -> float:
        """Seconds since the clip's first frame."""
        return self.frame / self.fps


@dataclasses.dataclass(frozen=True, eq=False)
class Capture:
    """One moment, seen by all cameras.

    - `index`: in the job that made it
    - `visit`: of an environment, from 0
    - `phase`: name of the capture series
    - `environment`: asset or name of the room
    - `clip`: None for captures that stand alone
    - `split`: "train", "val" ...; empty when the format has none
    - `frames`: one per camera
    - `findings`: what is wrong with its files"""

    index: int
    visit: int = 0
    phase: str = ""
    environment: str = ""
    clip: ClipFrame | None = None
    split: str = ""
    frames: list[Frame] = dataclasses.field(default_factory=list)
    findings: list[Finding] = dataclasses.field(default_factory=list)


def _frame(values: dict[str, Any]) -> Frame:
    camera = values.pop("camera")
    for key in ("distortion", "fisheye_polynomial"):
        camera[key] = tuple(camera[key])
    instances = []
    for instance in values.pop("instances"):
        seen, velocity = instance.pop("visibility"), instance.pop("velocity")
        instances.append(Instance(**instance, visibility=seen and Visibility(**seen),
                                  velocity=velocity and Velocity(**velocity)))
    joints = [JointState(**joint) for joint in values.pop("joints")]
    return Frame(camera=Camera(**camera), instances=instances, joints=joints, **values)


def _capture(values: dict[str, Any]) -> Capture:
    values["frames"] = [_frame(frame) for frame in values["frames"]]
    values["clip"] = values["clip"] and ClipFrame(**values["clip"])
    values["findings"] = [Finding(**finding) for finding in values["findings"]]
    return Capture(**values)


def _refused(kind: str, text: str) -> Error:
    error = Error(text)
    error.kind = kind
    return error


def _names(wanted: Iterable[str]) -> list[str]:
    if isinstance(wanted, str):  # which has letters
        raise TypeError(f"wanted is a list of names, [{wanted!r}]")
    names: list[Any] = list(wanted) if isinstance(wanted, Iterable) else [wanted]
    if not all(isinstance(name, str) for name in names):
        raise TypeError(f"wanted is a list of names, not {wanted!r}")
    return sorted(set(names))


def _plain(value: Any) -> Any:
    """What JSON does not know."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"a job has texts, numbers, lists and mappings, not {value!r}")


def _json(value: Any, place: str) -> str:
    """Every character as it is, which is YAML, too: JSON's escapes are not."""
    try:
        return json.dumps(value, ensure_ascii=False, default=_plain)
    except TypeError as error:
        below = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, (list, tuple)) else ()
        for key, each in below:
            _json(each, f"{place}[{key!r}]")  # the innermost says where
        raise TypeError(f"{place}: {error}") from None


def _is_false(answer: object) -> bool:
    """Python's False, and that of comparisons of numpy and PyTorch."""
    return answer is False or (str(getattr(answer, "dtype", "")) in ("bool", "torch.bool") and not answer)


def _program() -> bytes:
    """The program of the same build, which knows where plugins are: in a build tree, beside the installed
    package, or on the PATH."""
    here = pathlib.Path(__file__).resolve()
    for level in (2, 4):
        program = here.parents[level] / "bin" / "diorama"
        if program.is_file():
            return os.fsencode(program)
    found = shutil.which("diorama")
    if found is None:
        raise _refused("plugin", f"the program 'diorama' is neither near {here.parent} nor on the PATH; plugins are found from there")
    return os.fsencode(pathlib.Path(found).resolve())


class Dataset(Sequence[Capture]):
    """A dataset that was opened: a sequence of captures, each read when it is asked for.

    - `folder`, `format`: where and what it is
    - `reader`: type of the component that reads it, or what was asked for as JSON
    - `holds`: channels and labels that some frame has
    - `cameras`: names
    - `captures`: `Capture.index` of each
    - `classes`: the format's own list; may be empty
    - `skeletons`: of keypoints by class, "" for all others: their names, and the places of those that lines join
    - `findings`: what opening found

    It can be handed to other processes (`torch.utils.data.DataLoader` with workers): they open it anew.
    Several threads may read at once."""

    def __init__(self, folder: str | os.PathLike[str], reader: str | Mapping[str, Any] = "",
                 wanted: Iterable[str] | None = None) -> None:
        named = os.fsdecode(folder)  # first, so that what is no name of a file is said
        if not isinstance(reader, (str, Mapping)):
            raise TypeError(f"reader is a type or a mapping with parameters, not {reader!r}")
        # Other processes may be in another folder by then.
        self._asked = (os.path.join(os.getcwd(), named), reader if isinstance(reader, str) else _json(dict(reader), "reader"))
        self._wanted = None if wanted is None else _names(wanted)
        self._open(named)
        unknown = sorted(set(self._wanted or ()) - set(self.holds))
        if unknown:
            raise _refused("usage", f"{self.folder}: does not hold {', '.join(unknown)}; it holds {', '.join(self.holds)}")

    def _open(self, folder: str) -> None:
        self._process = os.getpid()
        self._stored = _diorama.open_dataset(_program(), os.fsencode(folder), os.fsencode(self._asked[1]))
        info = self._stored.info()
        self.folder: str = info["folder"]
        self.reader: str = info["reader"]
        self.format: str = info["format"]
        self.holds: list[str] = info["holds"]
        self.cameras: list[str] = info["cameras"]
        self.captures: list[int] = info["captures"]
        self.classes: list[str] = info["classes"]
        self.skeletons: dict[str, tuple[list[str], list[tuple[int, int]]]] = info["skeletons"]
        self.findings: list[Finding] = [Finding(**finding) for finding in info["findings"]]

    def __len__(self) -> int:
        return len(self.captures)

    @overload
    def __getitem__(self, place: int) -> Capture: ...
    @overload
    def __getitem__(self, place: slice) -> list[Capture]: ...
    def __getitem__(self, place: int | slice) -> Capture | list[Capture]:
        if isinstance(place, slice):
            return [self[i] for i in range(*place.indices(len(self)))]
        try:
            place = range(len(self))[place]  # negative ones count from the end
        except IndexError:
            raise IndexError(f"{self.folder}: there is no capture at place {place} of {len(self)}") from None
        if os.getpid() != self._process:
            self._open(self._asked[0])  # after a fork the threads of readers are gone
        return _capture(self._stored.read(place, self._wanted))

    def __iter__(self) -> Iterator[Capture]:
        return (self[i] for i in range(len(self)))

    def __reduce__(self) -> tuple[type[Dataset], tuple[str, str, list[str] | None]]:
        return Dataset, (*self._asked, self._wanted)

    def __repr__(self) -> str:
        return f"<diorama.Dataset {self.folder}: {self.format}, {len(self)} captures, {len(self.cameras)} cameras>"

    def _crowd_below_px(self) -> int:
        """Of how few pixels the dataset's page says that they are a crowd."""
        try:
            below = json.loads(pathlib.Path(self.folder, "dataset.json").read_bytes())["conventions"]["crowd_below_px"]
        except (OSError, ValueError, KeyError, TypeError):  # there is no page, or it is somebody else's
            return 0
        return below if isinstance(below, int) else 0

    def to_coco(self, taxonomy: str = "class") -> dict[str, Any]:
        """The boxes and masks of all frames as COCO's detection files have them; nothing is written. File names are
        `<capture>_<camera>.png`. Masks are uncompressed run lengths, present where "instance_id" is held. Crowds (`iscrowd`)
        are those of a dataset in COCO's format: the label "iscrowd", or fewer pixels than its page counts as objects. Reads
        every capture."""
        names = list(self.classes)
        crowd_below_px = self._crowd_below_px()
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
                    annotation: dict[str, Any] = {
                        "id": len(annotations) + 1, "image_id": image["id"], "category_id": names.index(name) + 1,
                        "iscrowd": int(instance.labels.get("iscrowd") == "1"),
                        "bbox": [x_min, y_min, x_max - x_min, y_max - y_min], "area": (x_max - x_min) * (y_max - y_min)}
                    if frame.has_mask(instance):
                        mask = frame.mask(instance)
                        annotation["area"] = int(mask.sum())
                        annotation["iscrowd"] |= int(annotation["area"] < crowd_below_px)
                        annotation["segmentation"] = _run_lengths(mask)
                    annotations.append(annotation)
        categories = [{"id": i + 1, "name": name} for i, name in enumerate(names)]
        return {"images": images, "annotations": annotations, "categories": categories}


def _run_lengths(mask: Array) -> dict[str, Any]:
    """COCO's: down the columns, beginning with a run of zeros."""
    flat = np.concatenate([[0], mask.T.ravel().astype(np.int8), [1 - int(mask[-1, -1])]])
    ends = np.flatnonzero(np.diff(flat))
    counts = np.diff(np.concatenate([[0], ends])).tolist()
    return {"size": list(mask.shape), "counts": counts}


def open(folder: str | os.PathLike[str], *, reader: str | Mapping[str, Any] = "",
         wanted: Iterable[str] | None = None) -> Dataset:
    """Opens a dataset's folder, or a run's that holds one dataset.

    `reader` is the type of a reader for folders that none knows by itself, or a mapping with its parameters:
    {"type": "python", "file": "mine.py", "class": "Mine", "params": {...}}. `wanted` names what is to be read of
    `Dataset.holds`; the rest is left out, which saves time. Raises Error when there is no dataset, or several."""
    return Dataset(folder, reader, wanted)


def find(folder: str | os.PathLike[str]) -> Mapping[str, str]:
    """The datasets of a run: folder to the reader's type."""
    return dict(_diorama.find_datasets(_program(), os.fsencode(folder)))


def run(job: Mapping[str, Any] | str | os.PathLike[str], on_capture: Callable[[Capture], object], *,
        wanted: Iterable[str] = ("color", "instances", "instance_id"), settings: Mapping[str, Any] | None = None,
        seed: int | None = None, threads: int = 0) -> None:
    """Makes the captures of a job and hands each to `on_capture`, in their order, as soon as it is there; nothing is
    written to the disk. The function is called in the thread that called this one. While it works the next captures are
    made, until 256 MB of them wait.

    `job` is a file, or the same as a dictionary; its writers are not looked at. `wanted` names channels and the
    annotations "instances", "visibility", "amodal_mask" and "occlusion_order". `settings` overrides single values,
    {"renderer.samples": 16}. The same job and seed give the same pixels as `diorama run` writes, for any number of
    threads (0: all). The function ends the run by returning False or by an exception, which comes out here."""
    if not callable(on_capture):
        raise TypeError(f"on_capture is a function that takes a Capture, not {on_capture!r}")
    if inspect.isgeneratorfunction(on_capture) or inspect.iscoroutinefunction(on_capture):
        raise TypeError(f"on_capture is a plain function: nothing would run {on_capture!r}, which has yield or is async")
    if not isinstance(job, (Mapping, str, os.PathLike)) or job == "":
        raise TypeError(f"job is the name of a file, or a dictionary with what would be in it, not {job!r}")
    if not isinstance(settings or {}, Mapping):
        raise TypeError(f"settings are values by their names, {{'renderer.samples': 16}}, not {settings!r}")
    threads, seed = operator.index(threads), None if seed is None else operator.index(seed)
    if not 0 <= threads < 2**31 or (seed is not None and not 0 <= seed < 2**64):
        raise _refused("usage", f"threads are 0 or more, a seed is from 0 to 2^64 - 1; found {threads} and {seed}")
    file, text = ("", _json(dict(job), "job")) if isinstance(job, Mapping) else (job, "")
    sets = [f"{key}={_json(value, f'settings[{key!r}]')}" for key, value in (settings or {}).items()]

    def take(values: dict[str, Any]) -> bool:
        return not _is_false(on_capture(_capture(values)))

    _diorama.listen(_program(), os.fsencode(file), os.fsencode(text), [os.fsencode(each) for each in sets], seed, take,
                    _names(wanted), threads)
