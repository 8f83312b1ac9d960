# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

__version__: str

class Error(RuntimeError):
    kind: str

class OpenDataset:
    def info(self) -> dict[str, Any]: ...
    def read(self, place: int, wanted: list[str] | None = None) -> dict[str, Any]: ...

def open_dataset(program: str, folder: str, reader: str = "") -> OpenDataset: ...
def find_datasets(program: str, folder: str) -> list[tuple[str, str]]: ...
def listen(program: str, file: str, text: str, sets: list[str], seed: int | None,
           on_capture: Callable[[dict[str, Any]], object], needs: list[str], threads: int) -> None: ...

# What the plugin `python` hands to components of diorama.plugins, each for one call.

class Node:
    """A node of the scene's tree. Poses are 4 x 4 in metres; what is set holds for all below it."""

    name: str
    path: str  #: "/Assets/mug_01"
    parent: Node | None
    children: list[Node]
    labels: dict[str, str]  #: taxonomy to label, of this node alone; set it as a whole
    is_visible: bool  #: False hides all below it from cameras, not from physics
    parent_from_node: np.ndarray
    world_from_node: np.ndarray
    position: np.ndarray  #: of its origin in the world; setting it keeps rotation and scale
    world_bounds: tuple[np.ndarray, np.ndarray] | None  #: of the visible meshes at and below it
    has_mesh: bool
    is_light: bool
    is_camera: bool
    light_color: np.ndarray | None  #: nits; lux of a distant light
    def set_base_color(self, color: Sequence[float]) -> None:
        """Linear red, green, blue of all materials at and below it, instead of their textures."""

class Scene:
    root: Node
    def match(self, pattern: str) -> list[Node]:
        """Nodes by path in creation order: '*' is any text without '/', '**' any text."""
    def find(self, path: str) -> Node | None: ...
    def create(self, parent: Node, name: str) -> Node:
        """A taken name gets a number."""
    def erase(self, node: Node) -> None:
        """With all below it."""
    def load(self, asset: str, parent: Node) -> Node:
        """An asset by the job's path rules, as a new node."""

class Rng:
    def __init__(self, seed: int) -> None: ...
    def fork(self, key: int | str) -> Rng: ...
    def bits(self) -> int: ...
    def uniform(self, low: float = 0.0, high: float = 1.0) -> float: ...
    def normal(self, mean: float = 0.0, deviation: float = 1.0) -> float: ...
    def index(self, count: int) -> int: ...
    def chance(self, probability: float) -> bool: ...
    def unit_vector(self) -> np.ndarray: ...
    def rotation(self) -> np.ndarray: ...

class Files:
    """Paths are relative to the writer's folder, with '/'."""

    def add(self, path: str, content: bytes | str) -> None: ...
    def append(self, path: str, content: bytes | str) -> None:
        """Puts content at the end of a file that begins empty."""
    def record(self, line: str) -> None:
        """In write() alone: a line that finish() gets."""
