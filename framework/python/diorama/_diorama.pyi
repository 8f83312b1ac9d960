# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

_Array = np.ndarray[Any, np.dtype[Any]]

__version__: str
HEADERS: int  #: digest of the SDK's headers, which the plugin `python` compares

class Error(RuntimeError):
    """Something that Diorama refuses."""

    kind: str  #: "usage", "config", "plugin", "asset", "output" or "internal"

class OpenDataset:
    def info(self) -> dict[str, Any]: ...
    def read(self, place: int, wanted: list[str] | None = None) -> dict[str, Any]: ...

# Paths, and texts that may have some in them, are bytes, as the system has them.
def open_dataset(program: bytes, folder: bytes, reader: bytes = b"") -> OpenDataset: ...
def find_datasets(program: bytes, folder: bytes) -> list[tuple[str, str]]: ...
def listen(program: bytes, file: bytes, text: bytes, sets: list[bytes], seed: int | None,
           on_capture: Callable[[dict[str, Any]], bool], needs: list[str], threads: int) -> None: ...

# What the plugin `python` hands to components of diorama.plugins, each for one call.

class Node:
    """A node of the scene's tree. Poses are float64, 4 x 4, in metres; what is set holds for all below it."""

    @property
    def name(self) -> str:
        """The end of the path."""
    @property
    def path(self) -> str:
        '''"/Assets/mug_01"'''
    @property
    def parent(self) -> Node | None:
        """None above the root."""
    @property
    def children(self) -> list[Node]:
        """In their order."""
    labels: dict[str, str]  #: taxonomy to label, of this node alone; set it as a whole
    is_visible: bool  #: False hides all below it from cameras, not from physics
    parent_from_node: Any  #: float64, 4 x 4, metres
    world_from_node: Any  #: float64, 4 x 4, metres
    position: Any  #: float64, 3, metres: of its origin in the world; setting it keeps rotation and scale
    @property
    def world_bounds(self) -> tuple[_Array, _Array] | None:
        """Least and greatest corner, float64, 3 each, metres, of the visible meshes at and below it; None where there are none."""
    @property
    def has_mesh(self) -> bool:
        """Whether it has a shape of its own."""
    @property
    def is_light(self) -> bool:
        """Whether it shines."""
    @property
    def is_camera(self) -> bool:
        """Whether it takes pictures."""
    light_color: Any  #: float32, 3, or None: nits; lux of a distant light
    def set_base_color(self, color: Sequence[float] | _Array) -> None:
        """Linear red, green, blue of all materials at and below it, instead of their textures."""

class Scene:
    """The tree of nodes, for one call. Units are metres, z is up."""

    @property
    def root(self) -> Node:
        """The node above all others."""
    def match(self, pattern: str) -> list[Node]:
        """Nodes by path in creation order: '*' is any text without '/', '**' any text."""
    def find(self, path: str) -> Node | None:
        """The node at a path, or None."""
    def create(self, parent: Node, name: str) -> Node:
        """A taken name gets a number."""
    def erase(self, node: Node) -> None:
        """With all below it."""
    def load(self, asset: str, parent: Node) -> Node:
        """An asset by the job's path rules, as a new node."""
    def _end(self) -> None: ...

class Rng:
    def __init__(self, seed: int) -> None: ...
    def fork(self, key: int | str) -> Rng: ...
    def bits(self) -> int: ...
    def uniform(self, low: float = 0.0, high: float = 1.0) -> float: ...
    def normal(self, mean: float = 0.0, deviation: float = 1.0) -> float: ...
    def index(self, count: int) -> int: ...
    def chance(self, probability: float) -> bool: ...
    def unit_vector(self) -> _Array: ...
    def rotation(self) -> _Array: ...

class Files:
    """The files of a writer, for one call. Paths are relative to the writer's folder, with '/'."""

    def add(self, path: str, content: bytes | str) -> None:
        """A file; texts are written as UTF-8."""
    def append(self, path: str, content: bytes | str) -> None:
        """Puts content at the end of a file that begins empty."""
    def record(self, line: str) -> None:
        """In write() alone: a line that finish() gets."""
    def _end(self) -> None: ...

# Between the plugin and diorama.plugins alone; capsules hold addresses of the SDK's objects.

def scene_of(scene: Any, host: Any) -> Scene: ...
def rng_of(rng: Any) -> Rng: ...
def files_of(files: Any) -> Files: ...
def capture_files_of(files: Any) -> Files: ...
def dataset_of(info: Any) -> dict[str, Any]: ...
def capture_copy(capture: Any, needs: list[str]) -> dict[str, Any]: ...
def frame_copy(frame: Any, needs: list[str]) -> tuple[dict[str, Any], int]: ...
def set_channels(frame: Any, channels: Mapping[str, _Array]) -> None: ...
def store_capture(stored: Any, capture: Any) -> None: ...
