"""Inter-process channel between the flying child and its parent: orders to the child, status to the parent.

Neither end ever blocks; a message that does not fit into the socket's buffer is lost.
"""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any, Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.links.link import LinkCounters
from mavlink_bridge.messages import CommandAck
from mavlink_bridge.wire.codec import Codec
from outrider.onboard.orders import OPERATOR

_MAX_DATAGRAM_BYTES: Final = 65536
_STOP: Final = b"stop"
_BEAT: Final = b"beat"
PARENT_TIMEOUT_S: Final = 5.0
"""Time without a message from the parent after which the child counts the parent as lost (s).

Without a parent no orders arrive, and the autopilot is not asked to hold position when the child ends: the
child then asks the autopilot itself (``SupervisedNode.give_up``).
"""
_BEAT_PERIOD_S: Final = 0.5
"""Time between two beats (s)."""
_BUFFER_BYTES: Final = 1 << 20


def intercom() -> tuple[Channel, OrderLink]:
    """Return both ends of a new channel: the parent's and the child's."""
    there, here = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    for end in (there, here):
        end.setblocking(False)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
    return Channel(there), OrderLink(here)


class Channel:
    """Parent's end of the channel."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self._last_beat = 0.0

    def beat(self, now: float) -> None:
        """Tell the child at ``now`` (s) that the parent is alive; sends at most two beats a second."""
        if now - self._last_beat >= _BEAT_PERIOD_S:
            self._last_beat = now
            self._put(_BEAT)

    def fileno(self) -> int:
        """Return the file descriptor, readable when there is news."""
        return self._end.fileno()

    def order(self, frame: bytes) -> None:
        """Send a MAVLink frame to the companion, as if from its ground link."""
        self._put(frame)

    def stop(self) -> None:
        """Ask the child to end."""
        self._put(_STOP)

    def news(self) -> Iterator[dict[str, Any]]:
        """Yield the child's messages since the last call."""
        while (data := _received_from(self._end)) is not None:
            yield json.loads(data)

    def close(self) -> None:
        """Close this end."""
        self._end.close()

    def _put(self, data: bytes) -> None:
        _send_to(self._end, data)


class OrderLink:
    """Child's end of the channel: a ``Link`` for the loop, over which orders arrive.

    ``stop``: whether the parent has asked the child to end.
    """

    def __init__(self, end: socket.socket, clock: Callable[[], float] = time.monotonic) -> None:
        """Wrap the socket; ``clock`` returns seconds."""
        self._end, self._clock = end, clock
        self._codec = Codec(
            lambda identifier, _system, _component: identifier == mavlink.MAVLINK_MSG_ID_COMMAND_ACK
        )
        self._received = 0
        self._contact: float | None = None
        self.stop = False

    @property
    def alone(self) -> bool:
        """Whether nothing came from the parent for ``PARENT_TIMEOUT_S`` s.

        Before the parent's first message, the time counts from the first reading of this property.
        """
        if self._contact is None:
            self._contact = self._clock()
        return self._clock() - self._contact > PARENT_TIMEOUT_S

    @property
    def counters(self) -> LinkCounters:
        """Link counters: the number of received orders, and zeros."""
        return LinkCounters(self._received, 0, 0)

    def fileno(self) -> int:
        """Return the file descriptor, readable when a message from the parent waits."""
        return self._end.fileno()

    def receive(self) -> list[bytes]:
        """Return the orders received since the last call."""
        found = []
        while (data := _received_from(self._end)) is not None:
            self._contact = self._clock()
            if data == _STOP:
                self.stop = True
            elif data != _BEAT:
                found.append(data)
        self._received += len(found)
        return found

    def send(self, data: bytes) -> None:
        """Forward answers to the parent's orders as messages of ``kind`` ack; drop everything else."""
        for message in self._codec.feed(data, whole=True):
            if isinstance(message, CommandAck) and message.target_component == OPERATOR:
                self.tell(kind="ack", command=message.command, result=message.result)

    def tell(self, **news: object) -> None:
        """Send a message to the parent."""
        _send_to(self._end, json.dumps(news).encode())

    def close(self) -> None:
        """Do nothing: the end stays open until the process ends, for the messages after the loop."""

    def release(self) -> None:
        """Close this end in the process that does not fly."""
        self._end.close()


def _received_from(end: socket.socket) -> bytes | None:
    try:
        return end.recv(_MAX_DATAGRAM_BYTES) or None
    except OSError:
        return None


def _send_to(end: socket.socket, data: bytes) -> None:
    try:
        end.send(data)
    except OSError:
        return
