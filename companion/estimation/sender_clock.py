"""Clock of a sender: estimates from its time stamps when a measurement was true.

The delay of a message varies; its stamp (``time_boot_ms`` of GLOBAL_POSITION_INT and LOCAL_POSITION_NED) does
not. The *lag* arrival − stamp is the offset between the two clocks plus the delay. The estimator keeps a line
below all lags: the offset plus the least delay, which is a setting. The part of a lag above the line is the
age of the message. One-way messages cannot distinguish a link that became slow from a clock that stood still.
So the line falls with any lag, and rises no faster than clocks drift: **a growing delay never makes a message
younger**.

A sender that answers requests allows the distinction: the clock value in an answer was shown after the
request left, so the offset is at least the request's time minus that stamp, however slow the way back. The
line is set to that at once, and as long as answers arrive nothing else raises it: a message's age is then
never understated, and overstated by no more than the time the request took.

Without answers, two explanations are accepted after long evidence. First, a lag that has grown steadily for
half a minute is attributed to a clock of another rate, such as a simulator's (1 % and more); the rate is that
of the line below the lags as defined by Moon, Skelly and Towsley ("Estimation and removal of clock skew from
network delay measurements", 1999). Second, if for a whole minute no message was young enough to be useful,
that is attributed to the clock: a clock that stood for a moment must not ground a vehicle permanently. If the
stamps step *back* further than messages can overtake each other, the sender's clock has restarted. That is
accepted as soon as one second of the new clock has been received at the rate at which it was sent; delayed
messages arrive in a burst instead.

A track keeps its own time, which runs at the rate of the sender's clock and is read with an offset: it is the
sender's time if the stamps were usable from the first. So the result for a message depends neither on its
arrival time nor on its receiver, and where the stamps step, or are unusable, the track's time continues.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import islice, pairwise
from typing import NamedTuple

_SECOND = 1_000_000
_DRIFT = 200e-6
"""Rate at which the line rises: no quartz clock, and no two against each other, drift by more."""
_PIECE = 5 * _SECOND
"""µs; length of a piece, of which the least lag is kept."""
_MEMORY = 13
"""Number of pieces; from the first to the last they cover more than a minute."""
_EVIDENCE = 7
"""Number of pieces (half a minute) over which lags must have changed steadily for a rate to be learnt.

Steadily: all lags lie within ``_BENT`` of the whole change of one line, which a few steps of a delay do not.
A rate below ``_PLAIN`` is not worth the risk.
"""
_BENT, _PLAIN = 0.125, 0.002
_USELESS = 400_000
"""µs above the line; if all messages of a sender are older than this, it is unusable.

Below this they are only old.
"""
_STEP = 2 * _SECOND
"""µs; messages do not overtake each other by more, nor does a lag fall by more.

A larger step means that the clock was set or that the sender restarted.
"""
_WITNESSES = 3
"""Number of successive messages off the line that must agree before the line is set through them."""
_LIVE = 0.75
"""Least share of the span of their stamps over which those messages must arrive.

The messages of a queue that drains arrive in less.
"""
_FEW = 8
"""Number of messages that define the line of a ``brief`` clock."""
_ANSWERED = 10 * _SECOND
"""µs after an answer during which the lags cannot raise the line."""
_REPEATS = 4
"""Number of repetitions of one stamp, over at least a second, after which the clock counts as stopped.

Fewer repetitions are duplicates.
"""


class TrackTime(NamedTuple):
    """Time of a message in the track's own time, µs.

    ``stamped``: the time comes from the sender's stamp. Then there is one measurement of that time, and
    another with the same time is its duplicate.
    """

    time: int
    stamped: bool


class _Least(NamedTuple):
    """The least ``lag`` of a piece that started at ``begun``.

    ``received``: when its message arrived; ``above``: its distance above the line. All µs.
    """

    begun: int
    received: int
    lag: int
    above: float


class _Outlier(NamedTuple):
    """A message off the line."""

    received: int
    stamp: int

    @property
    def lag(self) -> int:
        """Arrival time minus stamp, µs."""
        return self.received - self.stamp


class SenderClock:
    """The clock of one sender; all times in µs.

    ``delay``: the least age of a message at its arrival. ``latest``: how far in time other messages may
    overtake one that is still dated, at least two seconds. ``skew``: the companion's time minus the track's
    own, as of the last message. ``support``: number of messages that support the line; ``laid``: number of
    times that a new line was set. ``brief``: the line is computed from the last few messages alone. This is
    for a simulation's clock, which stops whenever its machine is busy; a growing delay is then not detected.
    ``lost``: time that the sender's clock has lost against the companion's, according to its answers.
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
        "_outliers",
        "_pieces",
        "_rate",
        "_received",
        "_repeated",
        "_repeats",
        "_stamp",
        "_suspected",
        "_timed",
        "_tolerance",
        "brief",
        "laid",
        "lost",
        "skew",
        "support",
    )

    def __init__(self, delay: int, latest: int) -> None:
        self.skew = 0
        self.support = 0
        self.laid = 0
        self.brief = False
        self.lost = 0
        self._lag = 0
        self._answered: int | None = None
        self._lately: deque[int] = deque(maxlen=_FEW)
        self._delay = delay
        self._tolerance = max(latest, _STEP)
        # Track time minus stamp; None before the first stamp, and while the stamps are unusable.
        self._base: int | None = None
        self._begun = self._timed = False
        self._stamp = self._newest = 0
        self._repeats, self._repeated = 0, 0
        self._outliers: list[_Outlier] = []
        self._suspected = 0
        self._received = 0
        self._line = 0.0
        self._rate = 0.0
        self._pieces: deque[_Least] = deque(maxlen=_MEMORY)
        self._least = _Least(0, 0, 0, 0.0)

    def date(self, received: int, stamp: int) -> TrackTime | None:
        """Return when a message was true that arrived at ``received`` with ``stamp``.

        ``received`` is on the companion's clock, ``stamp`` on the sender's. A stamp of 0 means none: the
        message is dated by its arrival. Returns None for a message that cannot be dated: others overtook it
        by far, or it is one of the first that indicate a step of the clock.
        """
        if stamp <= 0:
            return self._by_arrival(received)
        if not self._begun:
            return self._begin(_Outlier(received, stamp), received - stamp, 1)
        if self._base is None:
            return self._outlier(_Outlier(received, stamp))
        lag = received - stamp
        expected = self._line + self._rate * max(received - self._received, 0)
        if stamp < self._newest - self._tolerance or lag < expected - self._tolerance:
            return self._outlier(_Outlier(received, stamp))
        if stamp != self._stamp:
            self._stamp, self._repeats, self._repeated = stamp, 0, received
            if stamp > self._newest:
                self._newest = stamp
        else:
            self._repeats += 1
            if self._repeats >= _REPEATS and received - self._repeated >= _SECOND:
                self._base = None
                return self._by_arrival(received)
        if self._outliers:
            self._outliers.clear()
        self.support += 1
        self._lag = lag
        self._lately.append(lag)
        self._follow(received, lag, expected)
        self.skew = round(self._line) - self._delay - self._base
        return TrackTime(stamp + self._base, True)

    def reads(self, received: int, stamp: int) -> int:
        """Return when another message of this sender was true, on the companion's clock.

        The estimate of the clock does not change.
        """
        if stamp <= 0 or self._base is None:
            return received - self._delay
        return min(stamp + self._base + self.skew, received - self._delay)

    @property
    def late(self) -> int:
        """Delay (µs) of the fastest of the last few messages above the line."""
        if self.brief or self._base is None or not self._lately:
            return 0
        return max(0, min(self._lately) - round(self._line))

    def answered(self, received: int, asked: int, stamp: int) -> None:
        """Record that the sender's clock showed ``stamp`` between ``asked`` and ``received``.

        ``asked`` and ``received`` are on the companion's clock; the stamp comes from the answer to a request.
        An answer from another clock than that of the messages is ignored.
        """
        if self.brief or self._base is None or not 0 < asked <= received:
            return
        if abs(received - stamp - self._lag) > self._tolerance:
            return
        self._answered = received
        received = max(received, self._received)
        line = self._line + self._rate * (received - self._received)
        # A message dated by this line gets the age that it would have if the request had taken no time. The
        # line is not set above the last lags, however: no message is younger than the least delay.
        least = min(asked - stamp + self._delay, *self._lately)
        if least > line:
            self.lost += round(least - line)
            self._received, self._line, self._rate = received, float(least), _DRIFT
            self._forget()
            self.skew = least - self._delay - self._base

    def _forget(self) -> None:
        """Discard the lags so far: they belong to another line."""
        self._pieces.clear()
        received, lag = self._received, self._lag
        self._least = _Least(received, received, lag, max(lag - self._line, 0.0))

    def _by_arrival(self, received: int) -> TrackTime:
        if not self._timed:
            # Track time starts near 0, not at the companion's time: it is then the same for all companions
            # that receive the same messages at the same intervals.
            self._timed, self.skew = True, received - self._delay
        return TrackTime(received - self._delay - self.skew, False)

    def _begin(self, last: _Outlier, lag: int, support: int) -> TrackTime:
        """Set the line through ``lag``; the track's time continues, as its skew stays unchanged."""
        received, stamp = last
        if not self._timed:
            self.skew = lag - self._delay
        self._begun = self._timed = True
        self.laid += 1
        self._base = lag - self._delay - self.skew
        self._stamp = self._newest = stamp
        self._repeats, self._repeated = 0, received
        self._outliers.clear()
        self._answered, self._lag = None, lag
        self._lately.clear()
        self._lately.append(lag)
        self._received, self._line, self._rate = received, float(lag), 0.0
        self._pieces.clear()
        self._least = _Least(received, received, lag, 0.0)
        self.support = support
        return TrackTime(stamp + self._base, True)

    def _outlier(self, new: _Outlier) -> TrackTime | None:
        """Date a message off the line; return None if it cannot be dated.

        Enough such messages that agree define a new line. If they contradict each other for a second there is
        no line, and messages are dated by their arrival.
        """
        suspects = self._outliers
        if not suspects:
            self._suspected = new.received
        elif new.stamp <= suspects[-1].stamp or abs(new.lag - suspects[-1].lag) > self._tolerance:
            # No running clock gives these two stamps in succession.
            suspects.clear()
            if new.received - self._suspected >= _SECOND:
                self._base = None
        suspects.append(new)
        first, count = suspects[0], len(suspects)
        if count > _WITNESSES:
            del suspects[1]
        lasted = new.received - first.received
        # A lag that is much smaller cannot be a delay, however its messages arrived.
        ahead = self._base is not None and new.lag < self._line - self._tolerance
        live = lasted >= _SECOND and lasted >= _LIVE * (new.stamp - first.stamp)
        if count >= _WITNESSES and (ahead or live):
            return self._begin(new, min(suspect.lag for suspect in suspects), count)
        return self._by_arrival(new.received) if self._base is None else None

    def _follow(self, received: int, lag: int, expected: float) -> None:
        """Keep the line at or below the lags; at the end of each piece, check whether it may be raised."""
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
            # Until then the line was kept level; it may have risen since.
            self._line += _DRIFT * (received - pieces[0].received)
        recent = list(islice(pieces, max(len(pieces) - _EVIDENCE, 0), None))
        learnt = _steady(recent)
        self._rate = _DRIFT + learnt
        if learnt > 0.0:
            # What was age above the line at the beginning of this period remains age.
            self._line = max(self._line, _laid(recent, self._rate, received) - recent[0].above)
        if len(pieces) == _MEMORY:
            youngest = _laid(pieces, _DRIFT, received)
            if youngest > self._line + _USELESS:
                self._line = youngest


def _laid(pieces: Sequence[_Least], rate: float, received: int) -> float:
    """Return the value at ``received`` of the line of this ``rate`` that touches ``pieces`` from below."""
    return min(piece.lag + rate * (received - piece.received) for piece in pieces)


def _steady(pieces: Sequence[_Least]) -> float:
    """Return the rate at which the lags have changed steadily; 0 if they have not, or it is not known yet."""
    if len(pieces) < _EVIDENCE:
        return 0.0
    rate = _slope_below(pieces)
    if abs(rate) < _PLAIN:
        return 0.0
    off = [piece.lag - rate * (piece.received - pieces[0].received) for piece in pieces]
    change = abs(rate) * (pieces[-1].received - pieces[0].received)
    return rate if max(off) - min(off) <= _BENT * change else 0.0


def _slope_below(pieces: Sequence[_Least]) -> float:
    """Return the slope of the highest line below all ``pieces``.

    It is the slope of the edge of their lower hull at the middle of their time.
    """
    hull: list[_Least] = []
    for point in pieces:
        while len(hull) > 1 and _slope(hull[-2], hull[-1]) >= _slope(hull[-1], point):
            hull.pop()
        hull.append(point)
    middle = (pieces[0].received + pieces[-1].received) / 2
    return next(_slope(a, b) for a, b in pairwise(hull) if b.received >= middle)


def _slope(a: _Least, b: _Least) -> float:
    return (b.lag - a.lag) / (b.received - a.received)
