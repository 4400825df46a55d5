"""Processes that take turns: a clock that they share, and that goes on when the last of them waits for it.

A process that gets no CPU time holds up the others and the clock. So nothing that depends on time depends on
the load of the machine, in spite of real processes, real sockets and real signals.
"""

from __future__ import annotations

import socket
from contextlib import suppress
from struct import Struct
from typing import Final

_WORD: Final = Struct("!cq")
_WAITS, _FORKS, _GOES_ON = b"w", b"f", b"g"
_SILENT_S: Final = 600.0
"""s of wall time after which a process that neither waits nor ends is a failure of the test."""


class Turns:
    """``WallClock`` of a process that takes turns with others; ``end``: its socket to the ``Conductor``."""

    offset_ns = 0

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self._now = 0
        self.wait_until(1)

    def now(self) -> int:
        """µs; it stands still between two waits."""
        return self._now

    def wait_until(self, instant: int) -> None:
        """Let the others have their turns until it is ``instant`` (µs)."""
        if instant <= self._now:
            return
        self._end.sendall(_WORD.pack(_WAITS, instant))
        word, self._now = _WORD.unpack(self._end.recv(_WORD.size, socket.MSG_WAITALL) or _WORD.pack(b" ", 0))
        if word != _GOES_ON:
            raise SystemExit("the test has ended")

    def seconds(self) -> float:
        """As ``time.monotonic``."""
        return self._now * 1e-6

    def sleep(self, seconds: float) -> None:
        """As ``time.sleep``."""
        self.wait_until(self._now + round(seconds * 1e6))

    def another(self) -> socket.socket:
        """The end for a process that is about to be forked: the clock waits for it from now on."""
        ours, theirs = socket.socketpair()
        with theirs:
            socket.send_fds(self._end, [_WORD.pack(_FORKS, 0)], [theirs.fileno()])
        return ours

    def become(self, end: socket.socket) -> None:
        """Use ``end``, in the forked process."""
        self._end.close()
        self._end = end


class Conductor:
    """The test's side: gives each process its turn when its time has come.

    ``now``: time of the clock, µs.
    """

    def __init__(self, start: int) -> None:
        self.now = start
        self._waiting: dict[socket.socket, int] = {}
        self._running: list[socket.socket] = []

    def admit(self) -> socket.socket:
        """The end for another process, which counts as running until it waits or ends."""
        ours, theirs = socket.socketpair()
        self._add(ours)
        return theirs

    @property
    def alone(self) -> bool:
        """Whether all processes have ended."""
        self._listen()
        return not self._waiting

    def advance(self, until: int) -> None:
        """Give a turn to the process that waits for the earliest time.

        If no process waits for a time before ``until`` (µs), no process gets a turn, and it is ``until``.
        """
        self._listen()
        end, instant = min(self._waiting.items(), key=lambda item: item[1], default=(None, until))
        if end is None or instant >= until:
            self.now = max(self.now, until)
            return
        self.now = max(self.now, instant)
        del self._waiting[end]
        self._running.append(end)
        with suppress(OSError):  # The process has been killed; ``_listen`` removes it.
            end.sendall(_WORD.pack(_GOES_ON, self.now))
        self._listen()

    def close(self) -> None:
        """Close all ends: a process that waits, or will wait, raises SystemExit."""
        for end in (*self._waiting, *self._running):
            end.close()

    def _add(self, end: socket.socket) -> None:
        end.settimeout(_SILENT_S)
        self._running.append(end)

    def _listen(self) -> None:
        """Read from the processes until each of them waits or has ended."""
        while self._running:
            end = self._running[-1]
            try:
                data, handed, _, _ = socket.recv_fds(end, _WORD.size, 1, socket.MSG_WAITALL)
            except ConnectionError:
                data = b""
            if not data:
                end.close()
                self._running.remove(end)
                continue
            word, instant = _WORD.unpack(data)
            if word == _FORKS:
                self._add(socket.socket(fileno=handed[0]))
            else:
                self._running.remove(end)
                self._waiting[end] = instant
