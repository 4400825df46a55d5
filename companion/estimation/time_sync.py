"""Round-trip measurement of the autopilot's clock by TIMESYNC (111) when its messages seem late.

Messages with growing delay indicate either a slow link or a slow clock; one-way messages cannot distinguish
the two. A request and its response can: the autopilot's clock showed the returned time after the request was
sent. So its offset is known to within the time that the request took, regardless of how long the response
took (``SenderClock.answered``). No requests are sent while messages arrive as expected, unless ``always`` is
set, as long as it is not known whether the autopilot's clock is a simulation's.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from mavlink_bridge.messages import Source, Timesync

_NS_PER_US = 1000
"""Nanoseconds per microsecond.

The last three digits of a request's time (ns) are its sender's component id: they identify its response.
"""
_LATE_US = 20_000
"""Requests are sent if ``late`` is larger, the delay of the fastest of the last few messages."""
_PERIOD_US = 200_000
"""Time between two requests while messages are late."""
_UNHURRIED_US = 1_000_000
"""Time between two requests otherwise."""
_MAX_OPEN_REQUESTS = 32
"""Maximum number of requests whose response is awaited."""
_RESPONSE_TIMEOUT_US = 3_000_000
"""Time for which requests may remain without a response before ``unanswered`` reports it."""


class Answer(NamedTuple):
    """The autopilot's clock showed ``stamp`` after ``asked`` (own time) and before now; all µs."""

    asked: int
    stamp: int


class RoundTrips:
    """TIMESYNC exchange between the companion ``own`` and the autopilot of its system.

    ``regular``: requests are sent although messages arrive as expected, because images are dated by the
    answers. ``always``: the same, set while it is not known whether the clock is a simulation's.
    """

    def __init__(self, own: Source, *, regular: bool = False) -> None:
        self._own = own
        self._regular = regular
        self.always = False
        self.requested = 0
        """Own time (µs) of the last request; 0 before the first."""
        self.last: Answer | None = None
        """The last answer."""
        self._next = 0
        self._asked: deque[int] = deque(maxlen=_MAX_OPEN_REQUESTS)
        self._since: int | None = None

    def due(self, now: int, late: int) -> list[Timesync]:
        """Return the request due at ``now`` (µs), if any; ``late`` (µs): ``SenderClock.late``."""
        if late <= _LATE_US:
            self._since = None
            if not (self.always or self._regular):
                return []
        if now < self._next:
            return []
        self._next = now + (_PERIOD_US if late > _LATE_US else _UNHURRIED_US)
        self.requested = now
        if late > _LATE_US:
            self._since = now if self._since is None else self._since
        question = now * _NS_PER_US + self._own.component
        self._asked.append(question)
        return [Timesync(self._own, 0, question)]

    def receive(self, message: Timesync) -> Answer | None:
        """Return the answer if ``message`` is the first response to a request, otherwise None."""
        if message.tc1 <= 0 or message.ts1 not in self._asked:
            return None
        self._asked.remove(message.ts1)
        self._since = None
        self.last = Answer(message.ts1 // _NS_PER_US, message.tc1 // _NS_PER_US)
        return self.last

    def unanswered(self, now: int) -> bool:
        """Return whether requests are being sent and have had no response for ``_RESPONSE_TIMEOUT_US``."""
        return self._since is not None and now - self._since > _RESPONSE_TIMEOUT_US
