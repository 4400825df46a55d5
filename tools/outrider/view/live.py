"""Source of a flight in another process, at the other end of a channel."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from outrider.scene.datagram_channel import DatagramChannel
from outrider.scene.scene import Scene
from outrider.scene.snapshot import Snapshot
from outrider.scene.view_commands import ViewCommands, encoded
from outrider.view.player import Player


class Ready(NamedTuple):
    """First message of a view: the address at which it serves, or the reason why it does not."""

    url: str = ""
    error: str = ""


class Begin(NamedTuple):
    """Start of a flight: its ``scene``, and the initial view commands."""

    scene: Scene
    commands: ViewCommands


class Landed(NamedTuple):
    """End of the flight, which left a run in ``directory``."""

    directory: str


class LiveSource:
    """``Source`` at one end of ``line``; after the flight it plays the run that the flight left."""

    def __init__(self, line: DatagramChannel, load: Callable[[Path], Player]) -> None:
        self._line, self._load = line, load
        self._player: Player | None = None
        self._begin = ViewCommands()

    @property
    def span(self) -> tuple[float, float] | None:
        """Time span of the run; None during the flight."""
        return None if self._player is None else self._player.span

    @property
    def begin(self) -> ViewCommands:
        """Initial view commands of the flight; afterwards those of the run."""
        return self._begin if self._player is None else self._player.begin

    @property
    def hint(self) -> str:
        """Sentence shown to the user; empty during the flight."""
        return "" if self._player is None else self._player.hint

    def poll(self, wall: float) -> Sequence[Scene | Snapshot]:
        """Return the received data. If too much was sent, the channel has dropped some; the rest is shown."""
        if self._player is not None:
            return self._player.poll(wall)
        found: list[Scene | Snapshot] = []
        for data in self._line.receive():
            # Sent by the process that started this one, over a socket without a name that only processes of
            # this flight have.
            sent = pickle.loads(data)
            if isinstance(sent, Begin):
                self._begin = sent.commands
                found.append(sent.scene)
            elif isinstance(sent, Snapshot):
                found.append(sent)
            elif isinstance(sent, Landed):
                self._player = self._load(Path(sent.directory))
                return self._player.poll(wall)
        return found

    def command(self, commands: ViewCommands, sought: float | None) -> None:
        """Pass the view commands on; a flight in real time ignores pause, steps and speed."""
        if self._player is not None:
            self._player.command(commands, sought)
        else:
            self._line.send(encoded(commands))
