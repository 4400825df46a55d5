"""The clock of another machine, as its messages show it: an autopilot's, which may run ten times as fast as
the wall's.

A message shows what its sender's clock said when it left; it arrives later by a delay that changes. In the
plane of arrival and stamp all messages lie on or below the line of those that took no time. That line is laid
along the upper edge of what the last seconds brought, piece by piece (Moon, Skelly and Towsley, "Estimation
and removal of clock skew from network delay measurements", 1999), and the clock runs along it.

Only a simulation's clock is followed so, for good: on a busy machine it stands for a moment and never makes
up for that; then the clock goes on as if nothing were, and follows the stamps from there. A real autopilot's
clock is as good as the own one, and a delay that grows looks just like a clock that is slow: so there the
wall's time is better, by which what is old looks old. Which of the two it is, is decided once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from threading import Lock
from typing import Final, NamedTuple

from mavlink_bridge.clocks.clock import Clock

_PIECE: Final = 250_000
"""µs of the wall; of each piece the stamp that took the shortest way counts."""
_MEMORY: Final = 24
"""Pieces: six seconds."""
_ENOUGH: Final = 4
"""Pieces that a rate is learnt from."""
_STEP: Final = 500_000
"""µs of the wall: a stamp off the line by more tells of a clock that was set, stopped or began anew."""
_STALL: Final = 50_000
"""The same where the rate is off by more than ``_SPED``: a simulation stands whenever its machine has
something else to do."""
_SPED: Final = 0.02
_EVIDENCE, _MORE = 10_000_000, 30_000_000
"""µs of the wall after which it is decided what it is; and for a rate between ``_QUARTZ`` and ``_PACED``: a
simulation on a busy machine or a queue that grows, and no queue grows evenly for so long."""
_QUARTZ, _PACED = 0.005, 0.2
"""A clock whose rate is off by no more than the first is real, by more than the second a simulation's."""
_BENT: Final = 0.125
"""Even: all stamps within this share of what the rate has made of the time."""
_SLEW: Final = 0.5
"""A clock that is ahead goes on at this share of its rate: it never stands."""
_WITNESSES: Final = 5
SLOWEST, FASTEST = 0.02, 100.0
"""Rates beyond are none of a simulator's."""


class _Seen(NamedTuple):
    """A stamp (µs) that arrived at ``wall`` (µs)."""

    wall: int
    stamp: int


class FollowedClock:
    """A ``Clock`` that shows what the stamps do, from ``begin`` (µs) on; it never goes back.

    Before the first stamp it runs as ``clock`` does. Where stamps jump, by more than half a second of the
    wall, it goes on as before and follows them from there: ``steps`` counts that. So it does where a
    simulation has lost time. ``rate``: of it against ``clock``. May be fed by one thread and read by others.

    ``simulated`` says what it follows. None: that is found out, by ten to thirty seconds of stamps, and after
    them it runs on as ``clock`` does unless they are a simulation's.
    """

    def __init__(self, clock: Clock, begin: int = 0, *, simulated: bool | None = True) -> None:
        self._clock = clock
        self._lock = Lock()
        self._wall, self._shown = clock.now(), float(begin)
        self._latest = begin
        self._base: float | None = None
        self._pieces: deque[_Seen] = deque(maxlen=_MEMORY)
        self._best: _Seen | None = None
        self._begun = 0
        self._strayed = 0
        self._surplus = 0.0
        self._known = False
        self._verdict = simulated
        self._evidence: list[_Seen] = []
        self.rate = 1.0
        self.steps = 0
        self.judged: float | None = None
        """The rate by which it was decided what it follows; None before, and where that was known."""

    def now(self) -> int:
        """What it shows, µs."""
        with self._lock:
            return self._read(self._clock.now())

    def wait_until(self, instant: int) -> None:
        """Sleep until it shows ``instant`` (µs)."""
        while (left := instant - self.now()) > 0:
            # The line may be laid anew meanwhile: look again from time to time.
            pause = min(left / self.rate, _PIECE)
            self._clock.wait_until(self._clock.now() + max(1, round(pause)))

    def observe(self, wall: int, stamp: int) -> None:
        """A message with ``stamp`` (µs of the sender's clock) arrived at ``wall`` (µs of ``clock``)."""
        with self._lock:
            if self._verdict is False:
                return
            if self._base is None:
                self._lay(wall, stamp)
                return
            ahead = stamp + self._base - self._line(wall)
            stall = (_STALL if abs(self.rate - 1.0) > _SPED else _STEP) * max(1.0, self.rate)
            if self._known and abs(ahead) > stall:
                self._strayed += 1
                if self._strayed >= _WITNESSES:
                    if abs(ahead) > _STEP * max(1.0, self.rate):
                        self.steps += 1
                        self._evidence.clear()
                    # What came before less than that stays evidence: a delay that swings looks like it, again
                    # and again, and would have to be judged for ever.
                    self._lay(wall, stamp)
                return
            self._strayed = 0
            self._gather(_Seen(wall, stamp))

    @property
    def known(self) -> bool:
        """Whether its rate is known, and what it follows."""
        return self._verdict is False or (self._verdict is True and self._known)

    @property
    def verdict(self) -> bool | None:
        """What has been decided, or was said at the beginning: whether it is a simulation's. None before."""
        return self._verdict

    @property
    def simulated(self) -> bool:
        """Whether it follows a simulation's clock; as it seems so far until that is decided."""
        return self._off if self._verdict is None else self._verdict

    # Own, under the lock

    @property
    def _off(self) -> bool:
        return abs(self.rate - 1.0) > _PACED

    def _decide(self, wall: int) -> None:
        """When there is enough evidence: from here on it is the one or the other."""
        evidence = self._evidence
        span = evidence[-1].wall - evidence[0].wall
        if self._verdict is not None or span < _EVIDENCE:
            return
        rate = _slope_above(evidence)
        off = abs(rate - 1.0)
        if _QUARTZ < off <= _PACED and span < _MORE:
            return
        self.judged = rate
        self._verdict = off > _PACED or (off > _QUARTZ and _even(evidence, rate))
        evidence.clear()
        if not self._verdict:
            shown = float(self._read(wall))
            self._wall, self._shown, self._surplus, self.rate = wall, shown, 0.0, 1.0

    def _line(self, wall: int) -> float:
        return self._shown + self.rate * (wall - self._wall)

    def _slewed(self, wall: int) -> float:
        """The line, and what of a surplus is not worked off yet."""
        since = max(wall - self._wall, 0)
        return self._line(wall) + max(0.0, self._surplus - (1.0 - _SLEW) * self.rate * since)

    def _read(self, wall: int) -> int:
        self._latest = max(self._latest, int(self._slewed(wall)))
        return self._latest

    def _lay(self, wall: int, stamp: int) -> None:
        """Go on from what it shows, with the stamps from ``stamp`` on."""
        shown = float(self._read(wall))
        self._wall, self._shown, self._surplus = wall, shown, 0.0
        self._base = shown - stamp
        self._strayed = 0
        self._known = False
        self._pieces.clear()
        self._best, self._begun = _Seen(wall, stamp), wall

    def _gather(self, seen: _Seen) -> None:
        best = self._best
        if best is not None and seen.wall - self._begun >= _PIECE:
            # It ends before what comes now: much may come at once, and no two pieces have one time.
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
        """The line anew, from ``wall`` on."""
        pieces, base = self._pieces, self._base
        if base is None or len(pieces) < _ENOUGH:
            return
        rate = min(FASTEST, max(SLOWEST, _slope_above(pieces)))
        height = max(piece.stamp - rate * (piece.wall - wall) for piece in pieces)
        if not self._known:
            # Nobody has relied on the rate yet: go on without a jump.
            base = self._base = self._read(wall) - height
            self._known = True
        shown = float(self._read(wall))
        self._wall, self._shown, self.rate = wall, height + base, rate
        self._surplus = max(0.0, shown - self._shown)


def _even(pieces: Sequence[_Seen], rate: float) -> bool:
    """Whether all ``pieces`` are near one line of that rate, for how far it is from the wall's."""
    off = [piece.stamp - rate * (piece.wall - pieces[0].wall) for piece in pieces]
    return max(off) - min(off) <= _BENT * abs(rate - 1.0) * (pieces[-1].wall - pieces[0].wall)


def _slope_above(pieces: Sequence[_Seen]) -> float:
    """Slope of the line above all ``pieces`` that is nearest to them: the edge of their upper hull in the
    middle of their time."""
    hull: list[_Seen] = []
    for point in pieces:
        while len(hull) > 1 and _slope(hull[-2], hull[-1]) <= _slope(hull[-1], point):
            hull.pop()
        hull.append(point)
    middle = (pieces[0].wall + pieces[-1].wall) / 2
    return next(_slope(a, b) for a, b in pairwise(hull) if b.wall >= middle)


def _slope(a: _Seen, b: _Seen) -> float:
    return (b.stamp - a.stamp) / (b.wall - a.wall)
