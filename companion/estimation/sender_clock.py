"""When a measurement was true, by its sender's own clock.

A message arrives later by a delay that changes; its stamp (``time_boot_ms`` of GLOBAL_POSITION_INT and
LOCAL_POSITION_NED) does not. The *lag* arrival − stamp is the offset between the two clocks, plus the delay.
A line below all lags is the offset plus the least delay, which is a setting; what a lag is above the line is
age. One way alone, a link that became slow cannot be told from a clock that stood still. So the line falls
with any lag, and rises no faster than clocks drift: **a delay that grows never makes a message younger**.

A sender that can be asked tells the two apart: what its clock shows in an answer it showed after the question
left, so the offset is at least the question's time minus that stamp, however slow the way back. To that the
line is laid at once, and for as long as answers come nothing else raises it: a message's age is then never
understated, and overstated by no more than the question took.

Where no answers come, two things are believed after long evidence. A lag that has grown steadily for half a
minute is a clock of another rate, as a simulator's is (1 % and more); the rate is that of the line below the
lags, as Moon, Skelly and Towsley lay it ("Estimation and removal of clock skew from network delay
measurements", 1999). And where a minute long nothing was younger than would be of use, that is the clock:
one that stood for a moment must not ground a vehicle for ever. A step *back* of the stamps further than
messages can overtake each other is a clock that began anew, as soon as a second of it has been heard as it
was sent: what waited somewhere comes in a burst instead.

A track keeps its own time, which runs as the sender's clock does and is only read with an offset: it is the
sender's where stamps were of use from the first. So what a track makes of a message does not depend on when
it came, nor on who heard it; and where the stamps step, or are of no use, the track's time goes on.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import islice, pairwise
from typing import NamedTuple

_SECOND = 1_000_000
_DRIFT = 200e-6
"""The line rises at this rate: no quartz is off by more, nor two of them against each other."""
_PIECE = 5 * _SECOND
"""µs of which the least lag is kept."""
_MEMORY = 13
"""Pieces; from the first to the last they reach over a minute."""
_EVIDENCE = 7
"""Pieces, half a minute, over which lags must have changed steadily for a rate to be learnt: all within
``_BENT`` of the whole change of one line, as no few steps of a delay are. A rate below ``_PLAIN`` is not
worth the risk."""
_BENT, _PLAIN = 0.125, 0.002
_USELESS = 400_000
"""µs above the line; a sender that is so old all the time is out of use, below it is but old."""
_STEP = 2 * _SECOND
"""µs; messages do not overtake each other by more, nor does a lag fall by more: the clock was set, or the
sender began anew."""
_WITNESSES = 3
"""Successive messages off the line that agree with each other before it is laid through them."""
_LIVE = 0.75
"""So much of their stamps' span must the arrivals of witnesses take; a queue that drains takes less."""
_FEW = 8
"""Messages of a brief line."""
_ANSWERED = 10 * _SECOND
"""µs after an answer in which the line is not raised by what lags seem to say."""
_REPEATS = 4
"""The same stamp so often in succession, and for a second, is no duplicate: this clock stands."""


class Dated(NamedTuple):
    """``time`` in the track's own time, µs; ``stamped`` when it is the sender's word: then there is one
    measurement of that time, and another is its duplicate."""

    time: int
    stamped: bool


class _Least(NamedTuple):
    """The least ``lag`` of a piece that ``begun`` then, when it was ``received``, and how far it was
    ``above`` the line."""

    begun: int
    received: int
    lag: int
    above: float


class _Suspect(NamedTuple):
    """A message off the line."""

    received: int
    stamp: int

    @property
    def lag(self) -> int:
        return self.received - self.stamp


class SenderClock:
    """The clock of one sender, all times µs.

    ``delay``: the least age of a message at its arrival. ``latest``: by how much others may overtake one that
    is still dated, two seconds at least. ``skew``: the companion's time minus the track's own, as known at
    the last message. ``heard``: messages that the line stands on; ``laid``: how often there was a new one.
    ``brief``: the line is that of the last few messages alone. It is for a simulation's clock, which stands
    whenever its machine is busy; a delay that grows is then not seen. ``lost``: what the sender's clock has
    lost against ours, by its own answers.
    """

    __slots__ = (
        "_answered",
        "_base",
        "_begun",
        "_delay",
        "_lag",
        "_lately",
        "_least",
        "_line",
        "_newest",
        "_pieces",
        "_rate",
        "_received",
        "_repeated",
        "_repeats",
        "_stamp",
        "_suspected",
        "_suspects",
        "_timed",
        "_tolerance",
        "brief",
        "heard",
        "laid",
        "lost",
        "skew",
    )

    def __init__(self, delay: int, latest: int) -> None:
        self.skew = 0
        self.heard = 0
        self.laid = 0
        self.brief = False
        self.lost = 0
        self._lag = 0
        self._answered: int | None = None
        self._lately: deque[int] = deque(maxlen=_FEW)
        self._delay = delay
        self._tolerance = max(latest, _STEP)
        # Track time minus stamp; None before the first stamp, and while they are of no use.
        self._base: int | None = None
        self._begun = self._timed = False
        self._stamp = self._newest = 0
        self._repeats, self._repeated = 0, 0
        self._suspects: list[_Suspect] = []
        self._suspected = 0
        self._received = 0
        self._line = 0.0
        self._rate = 0.0
        self._pieces: deque[_Least] = deque(maxlen=_MEMORY)
        self._least = _Least(0, 0, 0, 0.0)

    def date(self, received: int, stamp: int) -> Dated | None:
        """When a message was true that arrived at ``received`` (the companion's time) with ``stamp`` (the
        sender's).

        A stamp of 0 is none: the message is dated by its arrival. None for one that cannot be dated: others
        overtook it by far, or it is one of the first that tell of a step.
        """
        if stamp <= 0:
            return self._by_arrival(received)
        if not self._begun:
            return self._begin(_Suspect(received, stamp), received - stamp, 1)
        if self._base is None:
            return self._suspect(_Suspect(received, stamp))
        lag = received - stamp
        expected = self._line + self._rate * max(received - self._received, 0)
        if stamp < self._newest - self._tolerance or lag < expected - self._tolerance:
            return self._suspect(_Suspect(received, stamp))
        if stamp != self._stamp:
            self._stamp, self._repeats, self._repeated = stamp, 0, received
            if stamp > self._newest:
                self._newest = stamp
        else:
            self._repeats += 1
            if self._repeats >= _REPEATS and received - self._repeated >= _SECOND:
                self._base = None
                return self._by_arrival(received)
        if self._suspects:
            self._suspects.clear()
        self.heard += 1
        self._lag = lag
        self._lately.append(lag)
        self._follow(received, lag, expected)
        self.skew = round(self._line) - self._delay - self._base
        return Dated(stamp + self._base, True)

    def reads(self, received: int, stamp: int) -> int:
        """When another message of this sender was true, on the companion's time; nothing is learnt of it."""
        if stamp <= 0 or self._base is None:
            return received - self._delay
        return min(stamp + self._base + self.skew, received - self._delay)

    @property
    def late(self) -> int:
        """By how much (µs) the quickest of the last few messages was later than the line has it."""
        if self.brief or self._base is None or not self._lately:
            return 0
        return max(0, min(self._lately) - round(self._line))

    def answered(self, received: int, asked: int, stamp: int) -> None:
        """The sender's clock showed ``stamp`` at some time between ``asked`` and ``received`` (ours): an
        answer to what was asked of it. One that is of another clock than its messages counts for nothing."""
        if self.brief or self._base is None or not 0 < asked <= received:
            return
        if abs(received - stamp - self._lag) > self._tolerance:
            return
        self._answered = received
        received = max(received, self._received)
        line = self._line + self._rate * (received - self._received)
        # Dated by that line a message is as old as it would be if the question had taken no time; but the
        # quickest are no younger than ever.
        least = min(asked - stamp + self._delay, *self._lately)
        if least > line:
            self.lost += round(least - line)
            self._received, self._line, self._rate = received, float(least), _DRIFT
            self._forget()
            self.skew = least - self._delay - self._base

    def _forget(self) -> None:
        """The lags so far were of another line."""
        self._pieces.clear()
        received, lag = self._received, self._lag
        self._least = _Least(received, received, lag, max(lag - self._line, 0.0))

    def _by_arrival(self, received: int) -> Dated:
        if not self._timed:
            # Not ours: so it is one for many who hear the same after the same time.
            self._timed, self.skew = True, received - self._delay
        return Dated(received - self._delay - self.skew, False)

    def _begin(self, last: _Suspect, lag: int, heard: int) -> Dated:
        """Lay the line through ``lag``. The track's time goes on: its skew stays what it was."""
        received, stamp = last
        if not self._timed:
            self.skew = lag - self._delay
        self._begun = self._timed = True
        self.laid += 1
        self._base = lag - self._delay - self.skew
        self._stamp = self._newest = stamp
        self._repeats, self._repeated = 0, received
        self._suspects.clear()
        self._answered, self._lag = None, lag
        self._lately.clear()
        self._lately.append(lag)
        self._received, self._line, self._rate = received, float(lag), 0.0
        self._pieces.clear()
        self._least = _Least(received, received, lag, 0.0)
        self.heard = heard
        return Dated(stamp + self._base, True)

    def _suspect(self, new: _Suspect) -> Dated | None:
        """One off the line: with enough others beside it there is a new line, and where they are all over the
        place there is none."""
        suspects = self._suspects
        if not suspects:
            self._suspected = new.received
        elif new.stamp <= suspects[-1].stamp or abs(new.lag - suspects[-1].lag) > self._tolerance:
            # No clock that runs says the one after the other.
            suspects.clear()
            if new.received - self._suspected >= _SECOND:
                self._base = None
        suspects.append(new)
        first, count = suspects[0], len(suspects)
        if count > _WITNESSES:
            del suspects[1]
        lasted = new.received - first.received
        # A lag that is much smaller is no delay, however its messages came.
        ahead = self._base is not None and new.lag < self._line - self._tolerance
        live = lasted >= _SECOND and lasted >= _LIVE * (new.stamp - first.stamp)
        if count >= _WITNESSES and (ahead or live):
            return self._begin(new, min(suspect.lag for suspect in suspects), count)
        return self._by_arrival(new.received) if self._base is None else None

    def _follow(self, received: int, lag: int, expected: float) -> None:
        """Keep the line at or below the lags; with every piece, see whether it may be laid higher."""
        if self.brief:
            self._received, self._line, self._rate = received, float(min(self._lately)), 0.0
            return
        self._received = received = max(received, self._received)
        self._line = line = min(float(lag), expected)
        least = self._least
        if received < least.begun + _PIECE:
            if lag < least.lag:
                self._least = _Least(least.begun, received, lag, lag - line)
            return
        self._pieces.append(least)
        self._raise(received)
        self._line = line = min(float(lag), self._line)
        self._least = _Least(received, received, lag, lag - line)

    def _raise(self, received: int) -> None:
        pieces = self._pieces
        if self._answered is not None and received - self._answered <= _ANSWERED:
            self._rate = _DRIFT
            self._forget()
            return
        if len(pieces) == 1:
            # Until then the line lay still; it may have risen since.
            self._line += _DRIFT * (received - pieces[0].received)
        recent = list(islice(pieces, max(len(pieces) - _EVIDENCE, 0), None))
        learnt = _steady(recent)
        self._rate = _DRIFT + learnt
        if learnt > 0.0:
            # What was age already when this began is age still.
            self._line = max(self._line, _laid(recent, self._rate, received) - recent[0].above)
        if len(pieces) == _MEMORY:
            youngest = _laid(pieces, _DRIFT, received)
            if youngest > self._line + _USELESS:
                self._line = youngest


def _laid(pieces: Sequence[_Least], rate: float, received: int) -> float:
    """Where at ``received`` a line of that rate is that touches the ``pieces`` from below."""
    return min(piece.lag + rate * (received - piece.received) for piece in pieces)


def _steady(pieces: Sequence[_Least]) -> float:
    """The rate at which lags have changed all the time; 0 where that is not so, or not yet known."""
    if len(pieces) < _EVIDENCE:
        return 0.0
    rate = _slope_below(pieces)
    if abs(rate) < _PLAIN:
        return 0.0
    off = [piece.lag - rate * (piece.received - pieces[0].received) for piece in pieces]
    change = abs(rate) * (pieces[-1].received - pieces[0].received)
    return rate if max(off) - min(off) <= _BENT * change else 0.0


def _slope_below(pieces: Sequence[_Least]) -> float:
    """Slope of the line below all ``pieces`` that is nearest to them: the edge of their lower hull in the
    middle of their time."""
    hull: list[_Least] = []
    for point in pieces:
        while len(hull) > 1 and _slope(hull[-2], hull[-1]) >= _slope(hull[-1], point):
            hull.pop()
        hull.append(point)
    middle = (pieces[0].received + pieces[-1].received) / 2
    return next(_slope(a, b) for a, b in pairwise(hull) if b.received >= middle)


def _slope(a: _Least, b: _Least) -> float:
    return (b.lag - a.lag) / (b.received - a.received)
