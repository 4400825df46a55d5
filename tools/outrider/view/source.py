"""Where moments come from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from outrider.scene.scene import Scene
from outrider.scene.snapshot import Moment
from outrider.scene.view_commands import Wishes


class Source(Protocol):
    """A flight, a run or links."""

    @property
    def span(self) -> tuple[float, float] | None:
        """From when to when (s) there is something, if that is known."""
        ...

    @property
    def begin(self) -> Wishes:
        """What is wished at first."""
        ...

    @property
    def hint(self) -> str:
        """A sentence for whoever looks on."""
        ...

    def poll(self, wall: float) -> Sequence[Scene | Moment]:
        """What is new at ``wall`` (s): a scene before its moments, and these in the order of time."""
        ...

    def wish(self, wishes: Wishes, sought: float | None) -> None:
        """What is wished; called again and again. ``sought``: a time (s) that somebody has just chosen."""
        ...
