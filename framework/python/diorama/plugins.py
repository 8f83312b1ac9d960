# SPDX-License-Identifier: Apache-2.0
"""Components of jobs in Python, for the bundled plugin `python`.

    from diorama.plugins import Randomizer, param

    class Stack(Randomizer):
        \"\"\"Puts objects on top of each other.\"\"\"

        nodes = param("/Assets/*", "Objects to stack.")
        gap_m = param(0.001, "Room between two of them.", unit="m", least=0.0)

        def randomize(self, scene, context, rng):
            height = 0.0
            for node in scene.match(self.nodes):
                ...

    randomizers:
      - {type: python, file: stack.py, class: Stack, params: {gap_m: 0.002}}

Files are looked up in the folders that the environment variable DIORAMA_PYTHON_PATH lists: a job alone runs no code.
"""
from __future__ import annotations

import dataclasses
import hashlib
import importlib.util
import math
import pathlib
import sys
import traceback
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from . import Capture, _capture, _diorama
from ._diorama import Error, Files, Node, Scene

__all__ = ["Capture", "Context", "DatasetInfo", "Error", "Files", "Node", "Parameter", "Randomizer", "Rng", "Scene", "Writer", "param"]


@dataclasses.dataclass(frozen=True)
class Parameter:
    """What a component declares; see param()."""

    default: Any
    help: str
    unit: str = ""
    least: float = -math.inf
    most: float = math.inf
    choices: tuple[str, ...] = ()


def param(default: Any, help: str, *, unit: str = "", least: float = -math.inf, most: float = math.inf,
          choices: Sequence[str] = ()) -> Any:
    """Declares a parameter as an attribute of a component's class. Its default says its type: bool, int, float, str,
    a list of str, a list of float, or a tuple of three floats. Numbers must lie in [least, most], texts among
    `choices` if there are any. Jobs are checked by it: unknown keys, wrong types and values are errors with their
    place. In methods the attribute is the value."""
    return Parameter(default, help, unit, least, most, tuple(choices))


@dataclasses.dataclass(frozen=True)
class Context:
    """When a randomizer acts."""

    moment: str  #: "environment" once per visit, before physics; or the name of a capture series
    capture: int  #: `Capture.index`; -1 at "environment"
    working_area: np.ndarray  #: centre, in the world
    occurrence: int  #: how often it acted at this moment before, over the whole job


class Rng:
    """Random numbers that follow from seed, visit, capture and the randomizer's name. Whoever draws from elsewhere
    breaks "same seed, same bytes", shards and resume."""

    def __init__(self, stream: _diorama.Rng) -> None:
        self._stream = stream

    def fork(self, key: str | int) -> Rng:
        """Another stream, whatever was drawn from this one. Fork by node path, so that one more node leaves the draws
        of the others as they were."""
        return Rng(self._stream.fork(key))

    def uniform(self, low: float = 0.0, high: float = 1.0) -> float:
        """In [low, high)."""
        return self._stream.uniform(low, high)

    def normal(self, mean: float = 0.0, deviation: float = 1.0) -> float:
        return self._stream.normal(mean, deviation)

    def index(self, count: int) -> int:
        """In [0, count)."""
        return self._stream.index(count)

    def choice(self, items: Sequence[Any]) -> Any:
        return items[self._stream.index(len(items))]

    def chance(self, probability: float) -> bool:
        return self._stream.chance(probability)

    def unit_vector(self) -> np.ndarray:
        """Uniform on the sphere."""
        return self._stream.unit_vector()

    def rotation(self) -> np.ndarray:
        """3 x 3, uniform over all rotations."""
        return self._stream.rotation()

    def generator(self) -> np.random.Generator:
        """For many numbers at once. numpy promises the bits of its generators for ever, not the distributions."""
        return np.random.Generator(np.random.Philox(self._stream.bits()))


class Randomizer:
    """Changes poses, lights, colours and the tree of nodes. One object is made per visit in flight; keep nothing from
    one call to the next."""

    def randomize(self, scene: Scene, context: Context, rng: Rng) -> None:
        raise NotImplementedError


@dataclasses.dataclass(frozen=True)
class DatasetInfo:
    """What a writer knows before the first capture. Equal in every shard."""

    seed: int
    captures: int  #: in the whole job
    cameras: list[str]
    labels: list[dict[str, str]]  #: every distinct label set of the job's objects
    classes: list[str]  #: class list in its order; empty: not settled
    validation: list[int] | None  #: captures kept for validation
    job: str  #: YAML; running it gives the same dataset
    version: str  #: of the program


class Writer:
    """Turns captures into files. `needs` lists the channels and annotations that write() reads: "color",
    "instance_id", "distance_to_image_plane", "instances", "visibility" ..."""

    needs: Sequence[str] = ("color", "instances")

    def begin(self, dataset: DatasetInfo, files: Files) -> None:
        """Once per run, before all captures."""

    def write(self, capture: Capture, files: Files) -> None:
        """By several threads in any order (the interpreter's lock lets one of them go on at a time). Names of files
        must follow from `capture.index`; `files.record` keeps a line for finish()."""
        raise NotImplementedError

    def finish(self, records: Callable[[Callable[[int, str], object]], None], files: Files) -> None:
        """Once all captures of the job are there: `records(visit)` calls visit(capture, line) for each record."""


_KINDS = {"randomizer": Randomizer, "writer": Writer}


class NoSuchClass(LookupError):
    """A job names a class that its file does not have."""


def _load(file: str, name: str, kind: str) -> type:
    """The class; a file is run once per process."""
    path = pathlib.Path(file)
    module_name = "_diorama_script_" + hashlib.sha256(file.encode()).hexdigest()[:16]
    module = sys.modules.get(module_name)
    if module is None:
        spec = importlib.util.spec_from_file_location(module_name, path)
        module = importlib.util.module_from_spec(spec)
        sys.modules[module_name] = module
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[module_name]
            raise
    base = _KINDS[kind]
    found = sorted(key for key, value in vars(module).items()
                   if isinstance(value, type) and issubclass(value, base) and value is not base)
    if name not in found:
        raise NoSuchClass(f"there is no {kind} '{name}'; it has {', '.join(found) or 'none'}"
                          f" (classes that are derived from diorama.plugins.{base.__name__})")
    return getattr(module, name)


def _type_of(default: Any, choices: tuple[str, ...]) -> str:
    if isinstance(default, bool):
        return "bool"
    if isinstance(default, int):
        return "int"
    if isinstance(default, float):
        return "float"
    if isinstance(default, str):
        return "choice" if choices else "str"
    if isinstance(default, tuple) and len(default) == 3 and all(isinstance(v, (int, float)) for v in default):
        return "vector"
    if isinstance(default, list) and all(isinstance(v, str) for v in default) and default:
        return "texts"
    if isinstance(default, list) and all(isinstance(v, (int, float)) for v in default):
        return "numbers"
    raise TypeError(f"a parameter is a bool, int, float, str, a list of str or of float, or three floats, not {default!r}")


def _params_of(cls: type) -> list[tuple[str, str, Parameter]]:
    """Key, type and declaration of each, those of base classes first."""
    all_of: dict[str, Parameter] = {}
    for each in reversed(cls.__mro__):
        all_of.update({key: value for key, value in vars(each).items() if isinstance(value, Parameter)})
    return [(key, _type_of(value.default, value.choices), value) for key, value in all_of.items()]


def _make(cls: type, values: dict[str, Any]) -> Any:
    component = cls.__new__(cls)
    for key, value in values.items():
        setattr(component, key, value)
    component.__init__()
    return component


def _say(error: BaseException, file: str) -> str:
    """Where in the file, and what."""
    if isinstance(error, SyntaxError) and error.filename == file:
        return f"{file}:{error.lineno}: {type(error).__name__}: {error.msg}"
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    place = f"{file}:{lines[-1]}" if lines else file
    return f"{place}: {type(error).__name__}: {error}"


def _randomize(component: Randomizer, scene: Any, host: Any, moment: str, capture: int, area: Sequence[float],
               occurrence: int, rng: Any) -> None:
    given = _diorama.scene_of(scene, host)
    try:
        component.randomize(given, Context(moment, capture, np.array(area), occurrence), Rng(_diorama.rng_of(rng)))
    finally:
        given._end()


def _begin(component: Writer, dataset: Any, files: Any) -> None:
    given = _diorama.files_of(files)
    try:
        component.begin(DatasetInfo(**_diorama.dataset_of(dataset)), given)
    finally:
        given._end()


def _write(component: Writer, capture: Any, needs: list[str], files: Any) -> None:
    given = _diorama.capture_files_of(files)
    try:
        component.write(_capture(_diorama.capture_copy(capture, needs)), given)
    finally:
        given._end()


def _finish(component: Writer, records: Any, files: Any) -> None:
    given = _diorama.files_of(files)
    try:
        component.finish(records, given)
    finally:
        given._end()
