"""What the autopilot's clock shows now: asked by TIMESYNC (111) when its messages look late.

Messages that come later and later tell of a link that becomes slow or of a clock that is slow, and never of
which. A question and its answer do: what the clock showed in the answer it showed after the question left, so
its offset is known to the time that the question took, whatever the answer took (``SenderClock.answered``).
Nothing is asked while messages come as expected.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from mavlink_bridge.messages import Source, Timesync

_NS = 1000
"""In a µs; a question's last three digits are its sender's component id, so that answers find home."""
_LATE = 20_000
"""µs by which the quickest of the last few messages has to be late."""
_PERIOD = 200_000
"""µs between two questions."""
_OPEN = 32
"""Questions whose answers are waited for."""
_PATIENCE = 3_000_000
"""µs of questions without an answer, after which there will be none."""


class Answer(NamedTuple):
    """The autopilot's clock showed ``stamp`` after ``asked`` (own time) and before now; all µs."""

    asked: int
    stamp: int


class RoundTrips:
    """Of the companion ``own`` to the autopilot of its system."""

    def __init__(self, own: Source) -> None:
        self._own = own
        self._next = 0
        self._asked: deque[int] = deque(maxlen=_OPEN)
        self._since: int | None = None

    def due(self, now: int, late: int) -> list[Timesync]:
        """The question, where one is due at ``now`` (µs); ``late``: by how much (µs) messages are."""
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
        """An answer to one of the questions, once; None for anything else on the link."""
        if message.tc1 <= 0 or message.ts1 not in self._asked:
            return None
        self._asked.remove(message.ts1)
        self._since = None
        return Answer(message.ts1 // _NS, message.tc1 // _NS)

    def unanswered(self, now: int) -> bool:
        """Whether messages are late, and nothing tells why."""
        return self._since is not None and now - self._since > _PATIENCE
