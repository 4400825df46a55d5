"""Interface of the sources of scenes and snapshots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from outrider.scene.scene import Scene
from outrider.scene.snapshot import Snapshot
from outrider.scene.view_commands import ViewCommands


class Source(Protocol):
    """Source of a picture: a flight, a run or links."""

    @property
    def span(self) -> tuple[float, float] | None:
        """First and last time (s) of the data, or None if that is not known."""
        ...

    @property
    def begin(self) -> ViewCommands:
        """Initial view commands."""
        ...

    @property
    def hint(self) -> str:
        """Sentence shown to the user."""
        ...

    def poll(self, wall: float) -> Sequence[Scene | Snapshot]:
        """Return new data at the wall time ``wall`` (s).

        A scene precedes its snapshots; snapshots are in order of time.
        """
        ...

    def command(self, commands: ViewCommands, sought: float | None) -> None:
        """Apply view commands. It is called repeatedly.

        ``sought`` is a time (s) that a user has just chosen, or None.
        """
        ...
