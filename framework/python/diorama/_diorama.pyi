# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable
from typing import Any

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
