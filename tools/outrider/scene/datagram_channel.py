"""Datagrams between who flies and who looks on: bounded, and neither end ever waits for the other."""

from __future__ import annotations

import socket

ROOM = 1 << 20
"""Bytes that may be under way; the system may allow less."""
_LARGEST = 1 << 20


class Line:
    """One ``end``, with ``room`` (bytes). ``dropped``: datagrams that there was no room for, or nobody left
    to take."""

    def __init__(self, end: socket.socket, room: int = ROOM) -> None:
        end.setblocking(False)
        for which in (socket.SO_SNDBUF, socket.SO_RCVBUF):
            end.setsockopt(socket.SOL_SOCKET, which, room)
        self._end = end
        self.dropped = 0

    def fileno(self) -> int:
        """Of the socket."""
        return self._end.fileno()

    def send(self, data: bytes) -> bool:
        """Pass ``data`` on if that is possible at once; whether it was."""
        try:
            self._end.send(data)
        except OSError:
            # Full, or too large for the system, or the other end is gone: nobody who flies may mind.
            self.dropped += 1
            return False
        return True

    def receive(self) -> list[bytes]:
        """All that has come."""
        found = []
        try:
            while True:
                found.append(self._end.recv(_LARGEST))
        except OSError:
            return found

    def close(self) -> None:
        """This end."""
        self._end.close()


def pair() -> tuple[socket.socket, socket.socket]:
    """Both ends; give each to a ``Line``."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
