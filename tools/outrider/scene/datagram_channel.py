"""Datagrams between a flight and its view: bounded, and neither end ever waits for the other."""

from __future__ import annotations

import socket

ROOM = 1 << 20
"""Bytes that may be under way; the system may allow less."""
_MAX_DATAGRAM_BYTES = 1 << 20


class DatagramChannel:
    """One ``end`` of the channel, with ``room`` (bytes).

    ``dropped``: number of datagrams for which there was no room or no receiver.
    """

    def __init__(self, end: socket.socket, room: int = ROOM) -> None:
        end.setblocking(False)
        for which in (socket.SO_SNDBUF, socket.SO_RCVBUF):
            end.setsockopt(socket.SOL_SOCKET, which, room)
        self._end = end
        self.dropped = 0

    def fileno(self) -> int:
        """Return the file descriptor of the socket."""
        return self._end.fileno()

    def send(self, data: bytes) -> bool:
        """Send ``data`` if that is possible at once; return whether it was sent."""
        try:
            self._end.send(data)
        except OSError:
            # Full, or too large for the system, or the other end is gone: the flight must not be affected.
            self.dropped += 1
            return False
        return True

    def receive(self) -> list[bytes]:
        """Return all datagrams that have arrived."""
        found = []
        try:
            while True:
                found.append(self._end.recv(_MAX_DATAGRAM_BYTES))
        except OSError:
            return found

    def close(self) -> None:
        """Close this end."""
        self._end.close()


def pair() -> tuple[socket.socket, socket.socket]:
    """Return both ends, each for a ``DatagramChannel``."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
