"""What joins the process that flies and the one that looks after it: orders there, news back. It never waits,
and what one cannot take is lost to it."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any, Final

from mavlink_bridge.links.link import LinkCounters
from mavlink_bridge.messages import CommandAck
from mavlink_bridge.wire.codec import Codec
from outrider.fly.orders import OPERATOR

_MOST: Final = 65536
_STOP: Final = b"stop"
_BEAT: Final = b"beat"
ALONE: Final = 5.0
"""s without a beat after which the child is on its own: nobody would hand on an order, nor have the last
word."""
_BETWEEN: Final = 0.5
"""s between two beats."""
_ACK: Final = 77
_BUFFER: Final = 1 << 20


def intercom() -> tuple[Desk, OrderLink]:
    """The parent's end, and the child's."""
    there, here = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    for end in (there, here):
        end.setblocking(False)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
    return Desk(there), OrderLink(here)


class Desk:
    """The parent's end."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self._beaten = 0.0

    def beat(self, now: float) -> None:
        """The parent looks after things at ``now`` (s); the child is told twice a second."""
        if now - self._beaten >= _BETWEEN:
            self._beaten = now
            self._put(_BEAT)

    def fileno(self) -> int:
        """Readable: there is news."""
        return self._end.fileno()

    def order(self, frame: bytes) -> None:
        """A MAVLink frame for the companion, as if from its ground link."""
        self._put(frame)

    def stop(self) -> None:
        """The child shall end."""
        self._put(_STOP)

    def news(self) -> Iterator[dict[str, Any]]:
        """What the child has said since the last time."""
        while (data := _taken(self._end)) is not None:
            yield json.loads(data)

    def close(self) -> None:
        """This end."""
        self._end.close()

    def _put(self, data: bytes) -> None:
        _given(self._end, data)


class OrderLink:
    """The child's end: to the loop a ``Link`` like the others, by which orders arrive. ``stop``: whether it
    has been told to end."""

    def __init__(self, end: socket.socket, clock: Callable[[], float] = time.monotonic) -> None:
        """``clock``: s."""
        self._end, self._clock = end, clock
        self._codec = Codec(lambda identifier, _system, _component: identifier == _ACK)
        self._received = 0
        self._heard: float | None = None
        self.stop = False

    @property
    def alone(self) -> bool:
        """Whether the parent has been silent for too long, since it was first asked."""
        if self._heard is None:
            self._heard = self._clock()
        return self._clock() - self._heard > ALONE

    @property
    def counters(self) -> LinkCounters:
        """Orders."""
        return LinkCounters(self._received, 0, 0)

    def fileno(self) -> int:
        """Readable: there are orders."""
        return self._end.fileno()

    def receive(self) -> list[bytes]:
        """Orders."""
        found = []
        while (data := _taken(self._end)) is not None:
            self._heard = self._clock()
            if data == _STOP:
                self.stop = True
            elif data != _BEAT:
                found.append(data)
        self._received += len(found)
        return found

    def send(self, data: bytes) -> None:
        """Of what is told to the ground, the answers to what was ordered here: as news of ``kind`` ack."""
        for message in self._codec.feed(data, whole=True):
            if isinstance(message, CommandAck) and message.target_component == OPERATOR:
                self.tell(kind="ack", command=message.command, result=message.result)

    def tell(self, **news: object) -> None:
        """Say something to the parent."""
        _given(self._end, json.dumps(news).encode())

    def close(self) -> None:
        """It stays open until the process ends: the last news comes after the loop."""

    def release(self) -> None:
        """Close this end in the process that does not fly."""
        self._end.close()


def _taken(end: socket.socket) -> bytes | None:
    try:
        return end.recv(_MOST) or None
    except OSError:
        return None


def _given(end: socket.socket, data: bytes) -> None:
    try:
        end.send(data)
    except OSError:
        return
