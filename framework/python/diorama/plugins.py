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
import importlib.machinery
import importlib.util
import inspect
import logging
import math
import pathlib
import sys
import traceback
import types
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from . import Array, Camera, Capture, Finding, Frame, Instance, Visibility, _capture, _diorama, _frame
from ._diorama import Error, Files, Node, Scene

__all__ = ["Annotator", "Camera", "Capture", "Context", "DatasetInfo", "Error", "Files", "Finding", "Frame", "Instance", "Node",
           "Parameter", "Randomizer", "Reader", "Rng", "Scene", "Stored", "Visibility", "Writer", "param"]


@dataclasses.dataclass(frozen=True)
class Parameter:
    """What a component declares.

    - `default`: bool, int, float, str, a list of str or float, or a tuple of three floats; says the type
    - `help`: for people
    - `unit`: "m", "deg" ...
    - `least`, `most`: of numbers, both allowed
    - `choices`: of texts; empty: any"""

    default: Any
    help: str
    unit: str = ""
    least: float = -math.inf
    most: float = math.inf
    choices: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        kind = _type_of(self.default, self.choices)
        if not all(isinstance(text, str) for text in (self.help, self.unit, *self.choices)):
            raise TypeError("the help, the unit and all choices of a parameter are texts")
        if self.choices and self.default not in self.choices:
            raise ValueError(f"the default {self.default!r} is none of the choices {', '.join(self.choices)}")
        numbers = [] if kind not in ("int", "float", "vector", "numbers") else \
            self.default if isinstance(self.default, (list, tuple)) else [self.default]
        for number in numbers:
            if not self.least <= number <= self.most:
                raise ValueError(f"the default {number!r} is not from {self.least!r} to {self.most!r}")
        if kind == "int" and not -2**31 <= self.default < 2**31:
            raise ValueError(f"a parameter of whole numbers has 32 bits, {self.default} has more")


def param(default: Any, help: str, *, unit: str = "", least: float = -math.inf, most: float = math.inf,
          choices: Sequence[str] = ()) -> Any:
    """Declares a parameter as an attribute of a component's class. Its default says its type: bool, int, float, str,
    a list of str, a list of float (an empty list, too), or a tuple of three floats. Numbers must lie in [least, most], texts among
    `choices` if there are any. Jobs are checked by it: unknown keys, wrong types and values are errors with their
    place. In methods the attribute is the value."""
    return Parameter(default, help, unit, least, most, tuple(choices))


@dataclasses.dataclass(frozen=True)
class Context:
    """When a randomizer acts.

    - `moment`: "environment" once per visit, before physics; or the name of a capture series
    - `capture`: `Capture.index`; -1 at "environment"
    - `working_area`: float64, 3: its centre in the world, metres
    - `occurrence`: how often it acted at this moment before, over the whole job"""

    moment: str
    capture: int
    working_area: Array
    occurrence: int


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
        """Gaussian."""
        return self._stream.normal(mean, deviation)

    def index(self, count: int) -> int:
        """In [0, count)."""
        return self._stream.index(count)

    def choice(self, items: Sequence[Any]) -> Any:
        """One of them, each as likely."""
        return items[self._stream.index(len(items))]

    def chance(self, probability: float) -> bool:
        """True with this probability, from 0 to 1."""
        return self._stream.chance(probability)

    def unit_vector(self) -> Array:
        """float64, 3: uniform on the sphere."""
        return self._stream.unit_vector()

    def rotation(self) -> Array:
        """float64, 3 x 3: uniform over all rotations."""
        return self._stream.rotation()

    def generator(self) -> np.random.Generator:
        """For many numbers at once. numpy promises the bits of its generators for ever, not the distributions."""
        return np.random.Generator(np.random.Philox(self._stream.bits()))


class Randomizer:
    """Changes poses, lights, colours and the tree of nodes. One object is made per visit in flight; keep nothing from
    one call to the next."""

    def randomize(self, scene: Scene, context: Context, rng: Rng) -> None:
        """Once per moment of the job's `on`. Scene and nodes are of no use after it; all chance comes from `rng`."""
        raise NotImplementedError


@dataclasses.dataclass(frozen=True)
class DatasetInfo:
    """What a writer knows before the first capture. Equal in every shard.

    - `seed`: of the job
    - `captures`: in the whole job
    - `cameras`: names
    - `labels`: every distinct label set of the job's objects
    - `classes`: class list in its order; empty: not settled
    - `validation`: captures kept for validation
    - `job`: YAML; running it gives the same dataset
    - `version`: of the program"""

    seed: int
    captures: int
    cameras: list[str]
    labels: list[dict[str, str]]
    classes: list[str]
    validation: list[int] | None
    job: str
    version: str


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


class Annotator:
    """Makes channels from what was rendered: `provides` lists them, `needs` the channels and annotations that
    annotate() reads ("color", "instance_id", "distance_to_image_plane", "instances" ...). It works where a job lists
    it and a writer needs what it makes, in front of the renderer's channel of that name."""

    needs: Sequence[str] = ()
    provides: Sequence[str] = ()

    def annotate(self, frame: Frame, rng: Rng) -> Mapping[str, Array]:
        """The channels of `provides` by name, as large as the picture: float32 (height, width), (height, width, 2)
        or (height, width, 3), uint32 (height, width), or uint8 (height, width, 4). `frame` holds what `needs` lists;
        `rng` is one stream per picture. One thread at a time; keep nothing from one call to the next."""
        raise NotImplementedError


class Stored:
    """A dataset that a Reader opened. Set the attributes, write read().

    - `format`: for people: "my tables"
    - `holds`: what captures may have: names of channels, "instances", "labels", "tight_boxes", "poses", "bounds", "camera",
      "camera_pose", "visibility" ... (diorama/reader.h lists them with what each means)
    - `cameras`: names
    - `captures`: `Capture.index` of each, ascending
    - `classes`: the format's class list, in its order
    - `steps`: to what it rounds, by what is held: metres, pixels"""

    format: str = ""
    holds: Sequence[str] = ()
    cameras: Sequence[str] = ()
    captures: Sequence[int] = ()
    classes: Sequence[str] = ()
    steps: Mapping[str, float] = types.MappingProxyType({})

    def read(self, place: int, wanted: frozenset[str]) -> Capture:
        """The capture at a place of `captures`. What `wanted` does not name may be left out; sizes of cameras are
        always there. Several threads may call it. What a damaged file raises (OSError, ValueError) becomes a finding of
        `diorama lint`."""
        raise NotImplementedError


class Reader:
    """Opens folders of a format of your own, for diorama.open(), lint, stats, view, convert and all else that reads
    datasets. It is found in the folders of DIORAMA_PYTHON_PATH, and its parameters then have their defaults; other values
    are given where it is named: --reader '{type: python, file: mine.py, class: Mine, params: {...}}'.

    `patterns` are files of which such a folder has one at least, "*" for any text inside one name: ("objects.csv",
    "boxes/*.txt"). Some file must lie right in the folder, with an ending, or in a folder right below."""

    patterns: Sequence[str] = ()

    def recognise(self, folder: pathlib.Path) -> bool:
        """Whether a folder with such a file is really of this format; look at small files alone."""
        return True

    def open(self, folder: pathlib.Path) -> Stored:
        """Raises OSError or ValueError when there is nothing that it could read."""
        raise NotImplementedError


_KINDS: dict[str, type[Any]] = {"annotator": Annotator, "randomizer": Randomizer, "reader": Reader, "writer": Writer}
_LOG = logging.getLogger("diorama")


class NoSuchClass(LookupError):
    """A job names a class that its file does not have."""


def _module_name(file: str) -> str:
    return "_diorama_script_" + hashlib.sha256(file.encode()).hexdigest()[:16]


class _SourceLoader(importlib.machinery.SourceFileLoader):
    """Runs what the file says now, and nothing else: compiled files beside it may be of another text that is as long
    and as old to the second, or of somebody who may write there."""

    def get_code(self, fullname: str) -> types.CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)


def _module(file: str) -> types.ModuleType:
    """A file is run once per process."""
    name = _module_name(file)
    module = sys.modules.get(name)
    if module is None:
        spec = importlib.util.spec_from_file_location(name, pathlib.Path(file), loader=_SourceLoader(name, file))
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[name]
            raise
    return module


def _classes_in(module: types.ModuleType, kind: str) -> dict[str, type[Any]]:
    base = _KINDS[kind]
    return {key: value for key, value in sorted(vars(module).items())
            if isinstance(value, type) and issubclass(value, base) and value is not base}


def _load(file: str, name: str, kind: str) -> type[Any]:
    found = _classes_in(_module(file), kind)
    if name not in found:
        raise NoSuchClass(f"there is no {kind} '{name}'; it has {', '.join(found) or 'none'}"
                          f" (classes that are derived from diorama.plugins.{_KINDS[kind].__name__})")
    return found[name]


def _each_class(kind: str, files: Sequence[tuple[str, str]]) -> Iterator[tuple[str, str, str, type[Any]]]:
    """File's name and path, class's name and class. Files that cannot be run are told and left out."""
    for name, path in files:
        try:
            module = _module(path)
        except (Exception, SystemExit) as error:
            _LOG.warning("%s (the file is left out)", _say(error, path))
            continue
        for key, cls in _classes_in(module, kind).items():
            if cls.__module__ == module.__name__:  # not those that it imports
                yield name, path, key, cls


def _classes(kind: str, files: Sequence[tuple[str, str]]) -> list[tuple[str, str, str, type[Any]]]:
    """File, class, help and the class itself, to describe them. Who has begun to run files has run those that the job
    names; others are then none of its business."""
    begun = [each for each in files if _module_name(each[1]) in sys.modules]
    found = []
    for file, path, name, cls in _each_class(kind, begun or files):
        text = (cls.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")
        help = " ".join(text.split()) or f"Parameters of {name}."
        found.append((file, name, help if help.endswith(".") else help + ".", cls))
    return found


def _readers_of(files: Sequence[tuple[str, str]], folder: str) -> list[tuple[str, str, type[Any]]]:
    """Path, title and class of each reader that knows the folder."""
    found = []
    root = pathlib.Path(folder)
    for name, path, key, cls in _each_class("reader", files):
        try:
            if _has_files(cls, root) and _with_defaults(cls).recognise(root):
                found.append((path, f"{name}: {key}", cls))
        except Exception as error:
            _LOG.warning("%s (the reader is left out)", _say(error, path))
    return found


def _has_files(reader: Reader | type[Reader], root: pathlib.Path) -> bool:
    return any(next(root.glob(pattern), None) is not None for pattern in _names(reader, "patterns"))


def _knows(reader: Reader, folder: str) -> bool:
    root = pathlib.Path(folder)
    return _has_files(reader, root) and reader.recognise(root)


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


def _params_of(cls: type[Any]) -> list[tuple[str, str, Parameter]]:
    """Key, type and declaration of each, those of base classes first."""

    all_of: dict[str, Parameter] = {}
    for each in reversed(cls.__mro__):
        for key, value in vars(each).items():
            if isinstance(value, Parameter):
                all_of[key] = value
            else:
                all_of.pop(key, None)  # settled by this class
    return [(key, _type_of(value.default, value.choices), value) for key, value in all_of.items()]


def _with_defaults(cls: type[Any]) -> Any:
    return _make(cls, {key: value.default for key, _, value in _params_of(cls)})


def _make(cls: type[Any], values: dict[str, Any]) -> Any:
    component: Any = object.__new__(cls)
    for key, value in values.items():
        setattr(component, key, value)
    _require_call(component.__init__, "__init__", ())
    component.__init__()
    for base, methods in _METHODS.items():
        if not isinstance(component, base):
            continue
        for name, is_optional in methods.items():
            _, *arguments = inspect.signature(getattr(base, name)).parameters
            if not is_optional and getattr(cls, name) is getattr(base, name):
                raise Unfit(f"{cls.__name__} has no method {name}({', '.join(['self', *arguments])})", cls)
            _require_call(getattr(component, name), name, arguments)
    return component


#: What is called, and whether a class may do without.
_METHODS: dict[type[Any], dict[str, bool]] = {
    Annotator: {"annotate": False}, Randomizer: {"randomize": False}, Reader: {"recognise": True, "open": False},
    Writer: {"begin": True, "write": False, "finish": True}}


class Unfit(TypeError):
    """A class that cannot be used as its base class says."""

    def __init__(self, text: str, what: Any) -> None:
        super().__init__(text)
        try:
            self.line: int | None = inspect.getsourcelines(what)[1]
        except (OSError, TypeError):
            self.line = None


def _require_call(method: Callable[..., Any], name: str, arguments: Sequence[str]) -> None:
    """Before it is called, so that the message is about the method and not about who calls it."""
    try:
        inspect.signature(method).bind(*arguments)
    except ValueError:
        pass  # compiled ones need not say what they take
    except TypeError:
        raise Unfit(f"{method.__qualname__} is called as {name}({', '.join(['self', *arguments])})", method) from None


def _names(component: Any, attribute: str) -> list[str]:
    """Of an object or a class."""
    names = getattr(component, attribute)
    cls = component if isinstance(component, type) else type(component)
    # A text is a sequence of texts, too.
    if isinstance(names, str) or not isinstance(names, Iterable) or not all(isinstance(name, str) for name in names):
        raise Unfit(f"{cls.__name__}.{attribute} is a list of texts, not {names!r}", cls)
    return list(names)


def _say(error: BaseException, file: str) -> str:
    """Where in the file, and what."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    line = lines[-1] if lines else None
    try:
        text = str(error)
    except Exception:
        text = "(its own text fails)"
    if isinstance(error, SyntaxError) and error.filename == file:
        line, text = error.lineno, str(error.msg)
    if isinstance(error, Unfit):
        line = error.line
    place = f"{file}:{line}" if line else file
    said = f"{place}: {type(error).__name__}: {text}" if text else f"{place}: {type(error).__name__}"
    return said.encode(errors="backslashreplace").decode()


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


def _annotate(component: Annotator, frame: Any, needs: list[str], provides: list[str]) -> None:
    values, seed = _diorama.frame_copy(frame, needs)
    rng = Rng(_diorama.Rng(seed).fork(type(component).__name__))
    made = component.annotate(_frame(values), rng)
    if not isinstance(made, Mapping) or set(made) != set(provides):
        found = ", ".join(sorted(made)) if isinstance(made, Mapping) else repr(type(made))
        raise TypeError(f"annotate() gives the channels {', '.join(sorted(provides))} by name, not {found or 'none'}")
    _diorama.set_channels(frame, {name: np.asarray(channel) for name, channel in made.items()})


def _open(reader: Reader, file: str, folder: str) -> tuple[Stored | None, str | None, dict[str, Any]]:
    """What was opened, or what is wrong with the folder; and what all its captures share."""
    name = type(reader).__name__
    try:
        stored = reader.open(pathlib.Path(folder))
    except (OSError, ValueError) as error:
        return None, _say(error, file), {}
    if not isinstance(stored, Stored):
        raise TypeError(f"{name}.open() returns a diorama.plugins.Stored, not {type(stored).__name__}")
    captures = [int(index) for index in stored.captures]
    info = {"format": stored.format or name, "holds": _names(stored, "holds"), "cameras": _names(stored, "cameras"),
            "captures": captures, "classes": _names(stored, "classes"), "steps": dict(stored.steps)}
    if captures != sorted(set(captures)):
        raise TypeError(f"{name}: captures ascend")
    return stored, None, info


def _read(stored: Stored, file: str, place: int, wanted: set[str], into: Any) -> None:
    index = stored.captures[place]
    try:
        capture = stored.read(place, frozenset(wanted))
    except (OSError, ValueError) as error:
        where = getattr(error, "filename", None)
        capture = Capture(int(index), findings=[Finding("every file can be read", str(where or "."), int(index), found=_say(error, file))])
    if not isinstance(capture, Capture) or capture.index != index:
        raise TypeError(f"read({place}) returns the diorama.Capture with index {index}")
    _diorama.store_capture(into, capture)


def _finish(component: Writer, records: Any, files: Any) -> None:
    given = _diorama.files_of(files)
    try:
        component.finish(records, given)
    finally:
        given._end()
