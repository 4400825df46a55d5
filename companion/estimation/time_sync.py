"""Round-trip measurement of the autopilot's clock by TIMESYNC (111) when its messages seem late.

Messages with growing delay indicate either a slow link or a slow clock; one-way delays cannot tell which. A
request and its response can: the autopilot's clock showed the returned time after the request was sent. So
its offset is known to within the time that the request took, regardless of how long the response took
(``SenderClock.answered``). No requests are sent while messages arrive as expected.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from mavlink_bridge.messages import Source, Timesync

_NS = 1000
"""ns per µs.

The last three digits of a request's time are its sender's component id, so that responses can be assigned.
"""
_LATE = 20_000
"""Delay (µs) of the fastest of the last few messages above which requests are sent."""
_PERIOD = 200_000
"""µs between two requests."""
_OPEN = 32
"""Maximum number of open requests."""
_PATIENCE = 3_000_000
"""µs of requests without a response, after which none is expected any more."""


class Answer(NamedTuple):
    """The autopilot's clock showed ``stamp`` after ``asked`` (own time) and before now; all µs."""

    asked: int
    stamp: int


class RoundTrips:
    """TIMESYNC exchange between the companion ``own`` and the autopilot of its system."""

    def __init__(self, own: Source) -> None:
        self._own = own
        self._next = 0
        self._asked: deque[int] = deque(maxlen=_OPEN)
        self._since: int | None = None

    def due(self, now: int, late: int) -> list[Timesync]:
        """Return the request that is due at ``now`` (µs), if any; ``late``: delay (µs) of the messages."""
        if late <= _LATE:
            self._since = None
            return []
        if now < self._next:
            return []
        self._next = now + _PERIOD
        self._since = now if self._since is None else self._since
        question = now * _NS + self._own.component
        self._asked.append(question)
        return [Timesync(self._own, 0, question)]

    def receive(self, message: Timesync) -> Answer | None:
        """Return the answer if ``message`` is the first response to a request, otherwise None."""
        if message.tc1 <= 0 or message.ts1 not in self._asked:
            return None
        self._asked.remove(message.ts1)
        self._since = None
        return Answer(message.ts1 // _NS, message.tc1 // _NS)

    def unanswered(self, now: int) -> bool:
        """Return whether messages are late and the requests have had no response for ``_PATIENCE``."""
        return self._since is not None and now - self._since > _PATIENCE
