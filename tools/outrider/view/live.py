"""Source of a flight in another process, at the other end of a channel."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import NamedTuple

from outrider.scene.datagram_channel import DatagramChannel
from outrider.scene.scene import Scene
from outrider.scene.snapshot import Snapshot
from outrider.scene.view_commands import ViewCommands, encoded
from outrider.view.player import Player

_MAX_BEGIN_BYTES = 100_000
"""Largest size of the start of a flight that is sent over the channel: many systems have room for 200 kB."""


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


class Filed(NamedTuple):
    """Message that is too large for the channel, in a ``file`` that the reader removes."""

    file: str


def packed(begin: Begin) -> tuple[bytes, Path | None]:
    """Return the message to send, and the file that it is in, if it is too large; or raise OSError."""
    data = pickle.dumps(begin)
    if len(data) <= _MAX_BEGIN_BYTES:
        return data, None
    with NamedTemporaryFile(prefix="outrider-scene-", delete=False) as file:
        file.write(data)
    return pickle.dumps(Filed(file.name)), Path(file.name)


def unpacked(data: bytes) -> object:
    """Return a received message; None if it was in a file that is not there any more."""
    sent = pickle.loads(data)
    if not isinstance(sent, Filed):
        return sent
    path = Path(sent.file)
    try:
        return pickle.loads(path.read_bytes())
    except FileNotFoundError:
        return None
    finally:
        path.unlink(missing_ok=True)


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
            sent = unpacked(data)
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
