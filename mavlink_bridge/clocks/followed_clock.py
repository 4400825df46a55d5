"""Clock of another machine, estimated from its messages; it may run ten times as fast as wall time.

A stamp is the time of the sender's clock when the message left; the message arrives later by a varying delay.
In the plane of arrival and stamp all messages lie on or below the line of messages without delay. That line
is fitted to the upper edge of the last seconds, piece by piece (Moon, Skelly and Towsley, "Estimation and
removal of clock skew from network delay measurements", 1999), and the clock runs along it.

Only a simulation's clock is followed permanently. On a busy machine such a clock stops for a moment and never
makes up for that. The followed clock then continues unchanged, and follows the stamps from there. A real
autopilot's clock is as accurate as the own one, and a growing delay looks just like a slow clock. For a real
autopilot wall time is therefore better, because old data then appears old. The clock decides once which of
the two it follows.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from threading import Lock
from typing import Final, NamedTuple

from mavlink_bridge.clocks.clock import Clock

_PIECE: Final = 250_000
"""Length of a piece in µs of wall time; the stamp with the shortest delay represents its piece."""
_MEMORY: Final = 24
"""Number of pieces that are kept: six seconds."""
_ENOUGH: Final = 4
"""Least number of pieces for an estimate of the rate."""
_STEP: Final = 500_000
"""Deviation from the line (µs of wall time) that shows that the clock was set, stopped or restarted."""
_STALL: Final = 50_000
"""The same limit where the rate is off by more than ``_SPED``.

It is lower because a simulation stops whenever its machine is busy with something else.
"""
_SPED: Final = 0.02
_EVIDENCE, _MORE = 10_000_000, 30_000_000
"""µs of wall time after which the kind of clock is decided.

The second is for a rate between ``_QUARTZ`` and ``_PACED``: a simulation on a busy machine or a growing
queue; no queue grows evenly for so long.
"""
_QUARTZ, _PACED = 0.005, 0.2
"""Limits of the rate error: up to the first the clock is real, above the second it is a simulation's."""
_BENT: Final = 0.125
"""Limit for even evidence: all stamps deviate by at most this share of the time that the rate has gained."""
_SLEW: Final = 0.5
"""Share of its rate at which a clock that is ahead continues: it never stops."""
_WITNESSES: Final = 5
SLOWEST, FASTEST = 0.02, 100.0
"""Limits of the rate; no simulator runs beyond them."""


class _Seen(NamedTuple):
    """A stamp (µs) that arrived at ``wall`` (µs)."""

    wall: int
    stamp: int


class FollowedClock:
    """``Clock`` that follows the stamps of another clock, from ``begin`` (µs) on; it never goes back.

    Before the first stamp it runs as ``clock`` does. Where stamps jump, by more than half a second of wall
    time, it continues as before and follows them from there; ``steps`` counts these jumps. It does the same
    where a simulation has lost time. ``rate``: its rate relative to ``clock``. One thread may feed it while
    others read it.

    ``simulated`` says whether the stamps are a simulation's. None: this is determined from ten to thirty
    seconds of stamps; after them, unless they are a simulation's, the clock runs as ``clock`` does.
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
        """Rate on which the decision was based; None before it, and where the kind of clock was given."""

    def now(self) -> int:
        """Return the time that this clock shows, µs."""
        with self._lock:
            return self._read(self._clock.now())

    def wait_until(self, instant: int) -> None:
        """Sleep until this clock shows ``instant`` (µs)."""
        while (left := instant - self.now()) > 0:
            # The line may be fitted again meanwhile, so read it again from time to time.
            pause = min(left / self.rate, _PIECE)
            self._clock.wait_until(self._clock.now() + max(1, round(pause)))

    def observe(self, wall: int, stamp: int) -> None:
        """Record a message with ``stamp`` (µs, sender's clock) that arrived at ``wall`` (µs of ``clock``)."""
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
                    # Evidence before a smaller jump is kept: a delay that swings looks like such a jump,
                    # again and again, and would never be judged otherwise.
                    self._lay(wall, stamp)
                return
            self._strayed = 0
            self._gather(_Seen(wall, stamp))

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
        """Whether it follows a simulation's clock; before the decision, what the rate suggests so far."""
        return self._off if self._verdict is None else self._verdict

    # The methods below need the lock.

    @property
    def _off(self) -> bool:
        return abs(self.rate - 1.0) > _PACED

    def _decide(self, wall: int) -> None:
        """Decide the kind of clock for good, once there is enough evidence."""
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
        """Return the line, plus the part of a surplus that is not worked off yet."""
        since = max(wall - self._wall, 0)
        return self._line(wall) + max(0.0, self._surplus - (1.0 - _SLEW) * self.rate * since)

    def _read(self, wall: int) -> int:
        self._latest = max(self._latest, int(self._slewed(wall)))
        return self._latest

    def _lay(self, wall: int, stamp: int) -> None:
        """Continue from the time shown, and follow the stamps from ``stamp`` on."""
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
            # The piece ends before the new message: many may arrive at once, and no two pieces have one time.
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
        if base is None or len(pieces) < _ENOUGH:
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
    """Return whether all ``pieces`` lie near one line of that rate, relative to its distance from 1."""
    off = [piece.stamp - rate * (piece.wall - pieces[0].wall) for piece in pieces]
    return max(off) - min(off) <= _BENT * abs(rate - 1.0) * (pieces[-1].wall - pieces[0].wall)


def _slope_above(pieces: Sequence[_Seen]) -> float:
    """Return the slope of the line above all ``pieces`` that is nearest to them.

    It is the edge of their upper hull in the middle of their time.
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
