"""A flight that another process flies, at the other end of a line."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from outrider.scene.datagram_channel import Line
from outrider.scene.scene import Scene
from outrider.scene.snapshot import Moment
from outrider.scene.view_commands import Wishes, encoded
from outrider.view.player import Player


class Ready(NamedTuple):
    """The first that a view says: where it serves, or why it does not."""

    url: str = ""
    error: str = ""


class Begin(NamedTuple):
    """A flight begins: its ``scene``, and what is wished at first."""

    scene: Scene
    wishes: Wishes


class Landed(NamedTuple):
    """It is over, and left a run in ``directory``."""

    directory: str


class Live:
    """The ``Source`` at one end of ``line``; after the flight, the run that it left."""

    def __init__(self, line: Line, load: Callable[[Path], Player]) -> None:
        self._line, self._load = line, load
        self._player: Player | None = None
        self._begin = Wishes()

    @property
    def span(self) -> tuple[float, float] | None:
        """Known once it is over."""
        return None if self._player is None else self._player.span

    @property
    def begin(self) -> Wishes:
        """As the flight says; afterwards as a run is played."""
        return self._begin if self._player is None else self._player.begin

    @property
    def hint(self) -> str:
        """Whose end this is."""
        return "" if self._player is None else self._player.hint

    def poll(self, wall: float) -> Sequence[Scene | Moment]:
        """What has come. If it was a lot, the line has dropped some; what is left is shown."""
        if self._player is not None:
            return self._player.poll(wall)
        found: list[Scene | Moment] = []
        for data in self._line.receive():
            # From the process that started this one, over a socket that nobody else has.
            told = pickle.loads(data)
            if isinstance(told, Begin):
                self._begin = told.wishes
                found.append(told.scene)
            elif isinstance(told, Moment):
                found.append(told)
            elif isinstance(told, Landed):
                self._player = self._load(Path(told.directory))
                return self._player.poll(wall)
        return found

    def wish(self, wishes: Wishes, sought: float | None) -> None:
        """Passed on; who does not fly a simulation heeds nothing."""
        if self._player is not None:
            self._player.wish(wishes, sought)
        else:
            self._line.send(encoded(wishes))
