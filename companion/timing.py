"""When a measurement was true, by its sender's own clock.

A message arrives later by a delay that changes; its stamp (``time_boot_ms`` of GLOBAL_POSITION_INT and
LOCAL_POSITION_NED) does not. The *lag* arrival − stamp is the offset between the two clocks, plus the delay:
its lower envelope is the offset plus the least delay, which is a setting. Quartz drifts by 1e-5, a simulated
autopilot by 1e-2 and more: the envelope is a line laid below the lags of some hundred messages as Moon,
Skelly and Towsley do ("Estimation and removal of clock skew from network delay measurements", 1999), shifted
to touch those of the last fifty, or of five seconds.

A track keeps its own time, which runs as the sender's clock does and is only read with an offset. So what a
track makes of a message does not depend on when it came; and where the stamps step, or are of no use, the
track's time goes on.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import islice, pairwise
from typing import NamedTuple

_SECOND = 1_000_000
_PIECE = 10
"""Messages of which the least lag is kept, or those of a second where they are fewer."""
_WINDOW = 5
"""Pieces; the line touches the least of the last ones. Fewer, and jitter would move it; more, and a clock
that stood still for a moment, as a simulator's does, would long be taken for a slow link."""
_MEMORY = 30
"""Pieces below which the line is laid: its slope is the rate of the sender's clock against ours."""
_FEW, _GROSS = 3, 0.2
"""Fewer pieces tell of no slope, and until ``_WINDOW`` of them one below this is taken for jitter."""
_STEP = 2 * _SECOND
"""µs; a lag further than this from the line, either way, is no delay: the clock was set, or the sender began
anew."""
_WITNESSES = 3
"""Successive messages off the line that agree with each other before it is laid through them."""
_REPEATS = 4
"""The same stamp so often in succession is no duplicate: this clock stands."""


class Dated(NamedTuple):
    """``time`` in the track's own time, µs; ``stamped`` when it is the sender's word: then there is one
    measurement of that time, and another is its duplicate."""

    time: int
    stamped: bool


class _Lag(NamedTuple):
    """The least of a piece that ``begun`` then, and when it was ``received``."""

    begun: int
    received: int
    lag: int


class SenderClock:
    """The clock of one sender, all times µs.

    ``delay``: the least age of a message at its arrival. ``latest``: how late one may be and still be dated,
    two seconds at least. ``skew``: the companion's time minus the track's own, as known at the last message.
    """

    def __init__(self, delay: int, latest: int) -> None:
        self.skew = 0
        self._delay = delay
        self._tolerance = max(latest, _STEP)
        # Track time minus stamp; None before the first stamp, and while they are of no use.
        self._base: int | None = None
        self._begun = False
        self._stamp = 0
        self._repeats = 0
        self._suspects: list[tuple[int, int]] = []
        self._received = 0
        self._offset = 0.0
        self._rate = 0.0
        self._piece = self._pieces = 0
        self._lags: deque[_Lag] = deque(maxlen=_MEMORY)

    def date(self, received: int, stamp: int) -> Dated | None:
        """When a message was true that arrived at ``received`` (the companion's time) with ``stamp`` (the
        sender's).

        A stamp of 0 is none: the message is dated by its arrival. None for one that cannot be dated: it is
        much later than the others, or the first of those that tell of a step.
        """
        if stamp <= 0:
            return self._by_arrival(received)
        lag = received - stamp
        if not self._begun:
            return self._begin(received, stamp, lag)
        if self._base is not None:
            expected = self._offset + self._rate * max(received - self._received, 0)
            if abs(lag - expected) <= self._tolerance:
                if stamp != self._stamp:
                    self._repeats = 0
                elif (repeats := self._repeats + 1) < _REPEATS:
                    self._repeats = repeats
                else:
                    self._base = None
                    return self._by_arrival(received)
                self._stamp = stamp
                if self._suspects:
                    self._suspects.clear()
                self._follow(received, lag, expected)
                self.skew = round(self._offset) - self._delay - self._base
                return Dated(stamp + self._base, True)
        return self._suspect(received, stamp, lag)

    def _by_arrival(self, received: int) -> Dated:
        return Dated(received - self._delay - self.skew, False)

    def _begin(self, received: int, stamp: int, lag: int) -> Dated:
        """Lay the line through ``lag``. The track's time goes on: its skew stays what it was."""
        self._begun = True
        self._base = lag - self._delay - self.skew
        self._stamp, self._repeats = stamp, 0
        self._suspects.clear()
        self._received, self._offset, self._rate = received, float(lag), 0.0
        self._piece = self._pieces = 0
        self._lags.clear()
        self._lags.append(_Lag(received, received, lag))
        return Dated(stamp + self._base, True)

    def _suspect(self, received: int, stamp: int, lag: int) -> Dated | None:
        """One off the line: with enough others beside it there is a new line, and where they are all over the
        place there is none."""
        suspects = self._suspects = [*self._suspects[1 - _WITNESSES :], (stamp, lag)]
        if len(suspects) == _WITNESSES:
            lags = [lag for _, lag in suspects]
            advancing = len({stamp for stamp, _ in suspects}) == _WITNESSES
            if advancing and max(lags) - min(lags) <= self._tolerance:
                return self._begin(received, stamp, min(lags))
            self._base = None
        return self._by_arrival(received) if self._base is None else None

    def _follow(self, received: int, lag: int, expected: float) -> None:
        """Keep the line at or below the lags; with every piece, lay it anew."""
        self._received = received = max(received, self._received)
        self._piece += 1
        last = self._lags[-1]
        full = self._piece >= _PIECE or received >= last.begun + _SECOND
        if not full or received == last.received:
            if lag < last.lag:
                self._lags[-1] = last._replace(received=received, lag=lag)
            self._offset = min(float(lag), expected)
            return
        self._piece = 0
        self._pieces += 1
        self._lags.append(_Lag(received, received, lag))
        if self._pieces <= _WINDOW:
            rate = _rate(self._lags) if self._pieces >= _FEW else 0.0
            self._rate = rate if abs(rate) > _GROSS else 0.0
        elif self._pieces % _WINDOW == 0:
            self._rate = _rate(self._lags)
        oldest = received - _WINDOW * _SECOND
        self._offset = min(
            lag + self._rate * (received - then)
            for _, then, lag in islice(reversed(self._lags), _WINDOW + 1)
            if then >= oldest
        )


def _rate(lags: Sequence[_Lag]) -> float:
    """Slope of the line below all ``lags`` that is nearest to them: the edge of their lower hull in the
    middle of their time."""
    hull: list[_Lag] = []
    for point in lags:
        while len(hull) > 1 and _slope(hull[-2], hull[-1]) >= _slope(hull[-1], point):
            hull.pop()
        hull.append(point)
    middle = (lags[0].received + lags[-1].received) / 2
    return next(_slope(a, b) for a, b in pairwise(hull) if b.received >= middle)


def _slope(a: _Lag, b: _Lag) -> float:
    return (b.lag - a.lag) / (b.received - a.received)
