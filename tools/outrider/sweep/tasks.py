"""Tasks for workers, and the entries that they return."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

from outrider.errors import OutriderError

Status = Literal["done", "fault", "lost"]


class Task(NamedTuple):
    """One run, identified by ``key`` (the hash of what is flown) and ``seed``.

    ``document`` is the scenario as JSON, or, if ``is_scene``, the scene that draws a scenario for the seed.
    ``vehicle`` is the scenario's vehicle as JSON.
    """

    key: str
    seed: int
    document: str = ""
    vehicle: str = ""
    is_scene: bool = False

    @property
    def run(self) -> tuple[str, int]:
        """Identity of the run."""
        return self.key, self.seed


class Entry(NamedTuple):
    """Result of a run.

    ``status`` is ``done``, with its ``summary``; ``fault``: it raised an error, described by ``what``; or
    ``lost``: its worker died or was too slow. ``wall_s`` is not part of the result.
    """

    key: str
    seed: int
    status: Status
    what: str | None
    summary: dict[str, Any] | None
    wall_s: float

    @property
    def run(self) -> tuple[str, int]:
        """Identity of the run."""
        return self.key, self.seed


Ended = Callable[[Entry], None]


class AbandonedError(OutriderError):
    """There are no workers left to run tasks. The entries of ended runs are kept."""
