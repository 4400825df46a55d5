"""What goes to a worker, and what comes back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

from outrider.errors import OutriderError

Status = Literal["done", "fault", "lost"]


class Task(NamedTuple):
    """One run: ``key`` (the hash of what is flown) and ``seed`` name it. ``document`` is the scenario as
    JSON, or, if ``is_scene``, the scene that draws one for the seed; ``vehicle`` is its vehicle as JSON."""

    key: str
    seed: int
    document: str = ""
    vehicle: str = ""
    is_scene: bool = False

    @property
    def run(self) -> tuple[str, int]:
        """What names the run."""
        return self.key, self.seed


class Entry(NamedTuple):
    """How a run ended. ``done`` with its ``summary``; ``fault``: it raised, and ``what`` says what; ``lost``:
    its worker died or was too slow. ``wall_s`` is no part of the result."""

    key: str
    seed: int
    status: Status
    what: str | None
    summary: dict[str, Any] | None
    wall_s: float

    @property
    def run(self) -> tuple[str, int]:
        """What names the run."""
        return self.key, self.seed


Ended = Callable[[Entry], None]


class AbandonedError(OutriderError):
    """There is nobody left to run tasks. What has ended is kept."""
