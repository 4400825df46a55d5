"""Clock of another machine, estimated from its messages; it may run much faster or slower than wall time.

A stamp is the time of the sender's clock when the message left; the message arrives later by a varying delay.
In the plane of arrival and stamp all messages lie on or below the line of messages without delay. That line
is fitted to the upper hull of the last seconds, one point for each piece of time (Moon, Skelly and Towsley,
"Estimation and removal of clock skew from network delay measurements", 1999), and the clock runs along it.

Only a simulation's clock is followed permanently. On a busy machine a simulation may stop for a moment and
never make up for it. ``FollowedClock`` then continues without a jump, with a new offset to the stamps. A real
autopilot's clock is as accurate as this machine's, and a growing delay looks like a slow clock. For a real
autopilot ``FollowedClock`` therefore runs on wall time, so that delayed data has its true age. The kind of
clock is decided once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import combinations, pairwise
from threading import Lock
from typing import Final, NamedTuple

from mavlink_bridge.clocks.clock import Clock

_PIECE_US: Final = 250_000
"""Length of a piece in wall time; the stamp with the shortest delay represents its piece."""
_MAX_PIECES: Final = 24
"""Number of pieces to which the line is fitted: six seconds."""
_MIN_PIECES: Final = 4
"""Least number of pieces for an estimate of the rate."""
_JUMP_US: Final = 500_000
"""Deviation from the line (wall time) that indicates that the clock was set, stopped or restarted."""
_STALL_US: Final = 50_000
"""The same limit if the rate error is more than ``_MIN_STALL_RATE_ERROR``.

It is lower because a simulation stops whenever its machine is busy with something else.
"""
_MIN_STALL_RATE_ERROR: Final = 0.02
_MIN_EVIDENCE_US, _MIN_UNCLEAR_EVIDENCE_US = 10_000_000, 30_000_000
"""Wall time after which the kind of clock is decided.

The second is for a rate error between ``_MAX_REAL_RATE_ERROR`` and ``_MIN_SIMULATED_RATE_ERROR``: a
simulation on a busy machine, or a growing queue. Round trips tell the two apart; without them it is assumed
that no queue grows evenly for 30 s.
"""
_MAX_REAL_RATE_ERROR, _MIN_SIMULATED_RATE_ERROR = 0.005, 0.2
"""Limits of |rate − 1|: up to the first the clock is real, above the second it is a simulation's."""
_MAX_UNEVENNESS: Final = 0.125
"""Limit for even evidence: largest spread of the stamps about the line, as a share of |rate − 1| · span."""
_MAX_TRIPS: Final = 128
"""Number of round trips kept."""
_MIN_TRIPS_SHARE: Final = 0.5
"""Share of the time of the evidence that round trips must cover to count."""
_TRIPS_TOLERANCE: Final = 0.001
"""Rate error that a real clock may have where round trips exclude more."""
_SLEW_RATE: Final = 0.5
"""Share of the rate with which a clock that is ahead of the line continues until the line reaches it."""
_JUMP_CONFIRMATIONS: Final = 5
"""Number of consecutive deviating stamps that confirm a jump."""
SLOWEST, FASTEST = 0.02, 100.0
"""Limits to which the estimated rate is clipped."""


class _Seen(NamedTuple):
    """A stamp (µs) that arrived at ``wall`` (µs)."""

    wall: int
    stamp: int


class _Trip(NamedTuple):
    """The followed clock showed ``stamp`` (µs) between ``asked`` and ``received`` (µs of wall time)."""

    asked: int
    received: int
    stamp: int


class FollowedClock:
    """``Clock`` that begins at ``begin`` (µs), follows the stamps of another clock, and never goes back.

    Before the first stamp it runs as ``clock`` does. Where stamps jump by more than half a second of wall
    time, it continues without a jump and takes the new offset; ``steps`` counts these jumps. It does the
    same, uncounted, for a jump of more than 50 ms of wall time if the rate error is more than 2 %. ``rate``:
    its rate relative to ``clock``. One thread may feed it while others read it.

    ``simulated``: whether the stamps are a simulation's. None: this is decided after ten to thirty seconds of
    stamps; if they are not a simulation's, the clock then runs as ``clock`` does. Stamps alone cannot tell a
    slow clock from a delay that grows evenly; with round trips (``answered``) a delay is never taken for a
    rate.
    """

    def __init__(self, clock: Clock, begin: int = 0, *, simulated: bool | None = True) -> None:
        self._clock = clock
        self._lock = Lock()
        self._wall, self._shown = clock.now(), float(begin)
        self._latest = begin
        self._base: float | None = None
        self._pieces: deque[_Seen] = deque(maxlen=_MAX_PIECES)
        self._best: _Seen | None = None
        self._begun = 0
        self._deviating = 0
        self._surplus = 0.0
        self._known = False
        self._verdict = simulated
        self._evidence: list[_Seen] = []
        self._trips: deque[_Trip] = deque(maxlen=_MAX_TRIPS)
        self.rate = 1.0
        self.steps = 0
        self.judged: float | None = None
        """Rate on which the decision was based; None before it, and where the kind of clock was given."""

    def now(self) -> int:
        """Return the time that this clock shows, µs."""
        with self._lock:
            return self._read(self._clock.now())

    def wait_until(self, instant: int) -> None:
        """Sleep until this clock shows ``instant`` (µs)."""
        while (left := instant - self.now()) > 0:
            # A new fit may change the line during the wait, so read the clock again after each piece.
            pause = min(left / self.rate, _PIECE_US)
            self._clock.wait_until(self._clock.now() + max(1, round(pause)))

    def observe(self, wall: int, stamp: int) -> None:
        """Record a message with ``stamp`` (µs, sender's clock) that arrived at ``wall`` (µs of ``clock``)."""
        with self._lock:
            if self._verdict is False:
                return
            if self._base is None:
                self._restart(wall, stamp)
                return
            ahead = stamp + self._base - self._line(wall)
            stall = (_STALL_US if abs(self.rate - 1.0) > _MIN_STALL_RATE_ERROR else _JUMP_US) * max(
                1.0, self.rate
            )
            if self._known and abs(ahead) > stall:
                self._deviating += 1
                if self._deviating >= _JUMP_CONFIRMATIONS:
                    if abs(ahead) > _JUMP_US * max(1.0, self.rate):
                        self.steps += 1
                        self._evidence.clear()
                        self._trips.clear()
                    # Evidence before a smaller jump is kept. A varying delay looks like repeated small jumps;
                    # if they cleared the evidence, the kind of clock would never be decided.
                    self._restart(wall, stamp)
                return
            self._deviating = 0
            self._gather(_Seen(wall, stamp))

    def answered(self, asked: int, received: int, stamp: int) -> None:
        """Record that the sender's clock showed ``stamp`` between ``asked`` and ``received``.

        ``stamp`` (µs, sender's clock) comes from the answer to a request; the others are µs of ``clock``.
        """
        with self._lock:
            if self._verdict is None and asked <= received:
                self._trips.append(_Trip(asked, received, stamp))

    @property
    def known(self) -> bool:
        """Whether the kind of clock is decided, and a simulation's rate is estimated."""
        return self._verdict is False or (self._verdict is True and self._known)

    @property
    def verdict(self) -> bool | None:
        """Whether the followed clock is a simulation's, as given or decided; None before the decision."""
        return self._verdict

    @property
    def simulated(self) -> bool:
        """Whether the stamps are a simulation's; before the decision, whether the rate so far suggests it."""
        return self._looks_simulated if self._verdict is None else self._verdict

    # Callers of the methods below hold the lock.

    @property
    def _looks_simulated(self) -> bool:
        return abs(self.rate - 1.0) > _MIN_SIMULATED_RATE_ERROR

    def _decide(self, wall: int) -> None:
        """Decide the kind of clock, once, when there is enough evidence."""
        evidence = self._evidence
        span = evidence[-1].wall - evidence[0].wall
        if self._verdict is not None or span < _MIN_EVIDENCE_US:
            return
        rate = _slope_above(evidence)
        off = abs(rate - 1.0)
        if _MAX_REAL_RATE_ERROR < off <= _MIN_SIMULATED_RATE_ERROR and span < _MIN_UNCLEAR_EVIDENCE_US:
            return
        self.judged = rate
        seems = off > _MIN_SIMULATED_RATE_ERROR or (off > _MAX_REAL_RATE_ERROR and _even(evidence, rate))
        self._verdict = seems and not _may_be_real(self._trips, span)
        evidence.clear()
        self._trips.clear()
        if not self._verdict:
            shown = float(self._read(wall))
            self._wall, self._shown, self._surplus, self.rate = wall, shown, 0.0, 1.0

    def _line(self, wall: int) -> float:
        return self._shown + self.rate * (wall - self._wall)

    def _slewed(self, wall: int) -> float:
        """Return the line at ``wall``, plus the part of the surplus that slewing has not removed yet."""
        since = max(wall - self._wall, 0)
        return self._line(wall) + max(0.0, self._surplus - (1.0 - _SLEW_RATE) * self.rate * since)

    def _read(self, wall: int) -> int:
        self._latest = max(self._latest, int(self._slewed(wall)))
        return self._latest

    def _restart(self, wall: int, stamp: int) -> None:
        """Continue from the time shown with a new offset to the stamps, and forget all pieces."""
        shown = float(self._read(wall))
        self._wall, self._shown, self._surplus = wall, shown, 0.0
        self._base = shown - stamp
        self._deviating = 0
        self._known = False
        self._pieces.clear()
        self._best, self._begun = _Seen(wall, stamp), wall

    def _gather(self, seen: _Seen) -> None:
        best = self._best
        if best is not None and seen.wall - self._begun >= _PIECE_US:
            # The new message begins the next piece, so that no two pieces have the same arrival time, even
            # if many messages arrive at once.
            self._pieces.append(best)
            self._fit(seen.wall)
            self._evidence.append(best)
            self._decide(seen.wall)
            best = None
        if best is None:
            self._best, self._begun = seen, seen.wall
        elif seen.stamp - best.stamp > self.rate * (seen.wall - best.wall):
            self._best = seen

    def _fit(self, wall: int) -> None:
        """Fit the line again, from ``wall`` on."""
        pieces, base = self._pieces, self._base
        if base is None or len(pieces) < _MIN_PIECES:
            return
        rate = min(FASTEST, max(SLOWEST, _slope_above(pieces)))
        height = max(piece.stamp - rate * (piece.wall - wall) for piece in pieces)
        if not self._known:
            # The rate has not been used yet: continue without a jump.
            base = self._base = self._read(wall) - height
            self._known = True
        shown = float(self._read(wall))
        self._wall, self._shown, self.rate = wall, height + base, rate
        self._surplus = max(0.0, shown - self._shown)


def _even(pieces: Sequence[_Seen], rate: float) -> bool:
    """Return whether all ``pieces`` lie near one line of slope ``rate``, relative to |rate − 1| · span."""
    off = [piece.stamp - rate * (piece.wall - pieces[0].wall) for piece in pieces]
    return max(off) - min(off) <= _MAX_UNEVENNESS * abs(rate - 1.0) * (pieces[-1].wall - pieces[0].wall)


def _may_be_real(trips: Sequence[_Trip], span: int) -> bool:
    """Return whether the ``trips`` cover enough of ``span`` (µs), and allow a clock of the rate 1.

    Between a trip and a later one the clock advanced by the difference of the stamps, in no more time than
    from the first request to the second answer, and in no less than from the first answer to the second
    request. This holds whatever the delays of both ways are.
    """
    if len(trips) < 2 or trips[-1].asked - trips[0].received < _MIN_TRIPS_SHARE * span:
        return False
    for first, second in combinations(trips, 2):
        shown = second.stamp - first.stamp
        most, least = second.received - first.asked, max(second.asked - first.received, 0)
        if not (1.0 - _TRIPS_TOLERANCE) * least <= shown <= (1.0 + _TRIPS_TOLERANCE) * most:
            return False
    return True


def _slope_above(pieces: Sequence[_Seen]) -> float:
    """Return the slope of the nearest line that lies above all ``pieces``.

    This line is the edge of their upper hull at the middle of their time span.
    """
    hull: list[_Seen] = []
    for point in pieces:
        while len(hull) > 1 and _slope(hull[-2], hull[-1]) <= _slope(hull[-1], point):
            hull.pop()
        hull.append(point)
    middle = (pieces[0].wall + pieces[-1].wall) / 2
    return next(_slope(a, b) for a, b in pairwise(hull) if b.wall >= middle)


def _slope(a: _Seen, b: _Seen) -> float:
    return (b.stamp - a.stamp) / (b.wall - a.wall)
