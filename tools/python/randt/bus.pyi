from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator

import numpy as np
import numpy.typing as npt

@dataclass(frozen=True)
class Topic:
    type_name: str
    head: np.dtype[Any]
    item: Any

@dataclass(frozen=True)
class Message:
    head: np.void
    items: npt.NDArray[Any]

class Subscription:
    def receive(self) -> Message | None: ...
    def wait(self, timeout_s: float) -> None: ...
    def __iter__(self) -> Iterator[Message]: ...

class Bus:
    def __init__(self, prefix: str = ..., run: str | Path | None = ...) -> None: ...
    def subscribe(self, name: str) -> Subscription: ...

CODES: dict[str, dict[int, str]]
TOPICS: dict[str, Topic]

def default_run() -> Path: ...
