"""Clock of a sender: estimates from its time stamps when a measurement was true.

The delay of a message varies; its stamp (``time_boot_ms`` of GLOBAL_POSITION_INT and LOCAL_POSITION_NED) does
not. The *lag* arrival − stamp is the offset between the two clocks plus the delay. The estimator keeps a line
(over the arrival time) at or below all lags: the estimated offset plus the least delay, which is a setting.
The age of a message is this least delay plus the part of its lag above the line. One-way messages
cannot distinguish a link that became slow from a clock that stood still. So the line falls to any lower lag
at once, and rises no faster than clocks drift: **a growing delay never makes a message younger**.

A sender that answers requests allows the distinction: the clock value in an answer was shown after the
request left, so the offset is at least the request's time minus that stamp, however slow the way back. The
line is raised to this offset plus the least delay at once; as long as answers arrive, only the drift also
raises it. A message's age is then never understated, and overstated by no more than the time that the request
took.

An answer also measures the delay. The offset lies between its lower bound and the lag of the last message, so
half of the difference is the delay of each way, if both take equally long, and wrong by no more than this
half if not (as in D. L. Mills, Network Time Protocol, RFC 5905, section 8). ``reads`` uses the best of the
last answers in place of the setting, because an image must be dated neither too early nor too late. As the
rate of the clock is not used there, it is wrong by what the clock loses since that answer, too.

Without answers, two explanations are accepted after long evidence. First, a lag that has changed steadily for
half a minute is attributed to a clock of another rate, such as a simulator's (1 % and more); the rate is that
of the line below the lags as defined by Moon, Skelly and Towsley ("Estimation and removal of clock skew from
network delay measurements", 1999). Second, if for a whole minute no message was young enough to be useful,
the cause is taken to be the clock: a clock that stood for a moment must not ground a vehicle permanently. If
the stamps step *back* further than messages can overtake each other, the sender's clock has restarted. A
restart is accepted as soon as one second of the new clock has been received at the rate at which it was sent;
delayed messages arrive in a burst instead. A step *forward* cannot be a delay: it is accepted after three
messages.

A track keeps its own time, which runs at the rate of the sender's clock; ``skew`` converts it to the
companion's. It equals the sender's time if the stamps were usable from the first. So a message's track time
depends neither on its arrival time nor on its receiver, and where the stamps step, or are unusable, the
track's time continues.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from companion.estimation.lag_pieces import MAX_PIECES, Piece, line_below, recent, steady_rate

_SECOND_US = 1_000_000
_DRIFT = 200e-6
"""Rate at which the line rises: two quartz clocks drift against each other by less."""
_PIECE_US = 5 * _SECOND_US
"""Length of a piece (an interval of time); the least lag of each piece is kept."""
_UNUSABLE_US = 400_000
"""The line is raised to the lags of ``MAX_PIECES`` pieces if all of them exceed it by more than this.

With messages of that age the sender would be unusable.
"""
_CLOCK_STEP_US = 2 * _SECOND_US
"""Messages do not overtake each other by more than this, and no lag falls by more than this.

A larger step means that the clock was set or that the sender restarted.
"""
_MIN_OUTLIERS = 3
"""Number of successive messages off the line that must agree before the line is set through them."""
_MIN_ARRIVAL_RATIO = 0.75
"""Least ratio of the span of these messages' arrivals to the span of their stamps.

The messages of a queue that drains have a smaller one.
"""
_LAST_LAGS = 8
"""Number of last lags kept, for ``late``, for ``answered`` and for the line of a ``brief`` clock."""
_ANSWER_VALID_US = 10 * _SECOND_US
"""Time after an answer during which the lags cannot raise the line, and it measures the delay."""
_ROUNDED_US = 1000
"""Stamps may be whole milliseconds."""
_AGEING = 0.01
"""Error (µs per µs of age) of a measured offset: simulations' clocks are off by as much."""
_MAX_REPEATS = 4
"""Number of repetitions of one stamp, over at least a second, after which the clock counts as stopped.

Fewer repetitions are duplicates.
"""


class TrackTime(NamedTuple):
    """Time of a message in the track's own time, µs.

    ``stamped``: the time comes from the sender's stamp; two messages with the same time are then duplicates.
    """

    time: int
    stamped: bool


class _Outlier(NamedTuple):
    """A message off the line."""

    received: int
    stamp: int

    @property
    def lag(self) -> int:
        """Arrival time minus stamp, µs."""
        return self.received - self.stamp


class _Measured(NamedTuple):
    """Offset of the sender's clock, wrong by at most ``delay``, by an answer that came ``at`` (µs).

    ``delay``: of each way if both take equally long.
    """

    offset: int
    delay: int
    at: int


class SenderClock:
    """The clock of one sender; all times in µs.

    ``delay``: the least age of a message at its arrival. ``latest``: by how much later messages may have
    overtaken a message that is still dated; values below 2 s act as 2 s. ``skew``: the companion's time minus
    the track's own, as of the last message. ``support``: number of messages that support the line; ``laid``:
    number of times that a new line was set. ``brief``: the line is the least of the last few lags. This mode
    is for a simulation's clock, which stops whenever its machine is busy; a growing delay is then not
    detected. ``lost``: time that the sender's clock has lost against the companion's, by its answers.
    """

    __slots__ = (
        "_answered",
        "_base",
        "_begun",
        "_delay",
        "_first_outlier_at",
        "_lag",
        "_last_lags",
        "_least",
        "_line",
        "_measured",
        "_newest",
        "_outliers",
        "_pieces",
        "_rate",
        "_received",
        "_repeated",
        "_repeats",
        "_stamp",
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
        self._measured: _Measured | None = None
        # A ring; its order has no meaning.
        self._last_lags: list[int] = []
        self._delay = delay
        self._tolerance = max(latest, _CLOCK_STEP_US)
        # Track time minus stamp; None before the first stamp, and while the stamps are unusable.
        self._base: int | None = None
        self._begun = self._timed = False
        self._stamp = self._newest = 0
        self._repeats, self._repeated = 0, 0
        self._outliers: list[_Outlier] = []
        self._first_outlier_at = 0
        self._received = 0
        self._line = 0.0
        self._rate = 0.0
        self._pieces: deque[Piece] = deque(maxlen=MAX_PIECES)
        self._least = Piece(0, 0, 0, 0.0)

    def date(self, received: int, stamp: int) -> TrackTime | None:
        """Return the track time at which the content of a message was true.

        The message arrived at ``received``, on the companion's clock, with ``stamp``, on the sender's. A
        message with stamp 0 has none and is dated by its arrival. Returns None for a message that cannot be
        dated: others overtook it by far, or it is one of the first that indicate a step of the clock.
        """
        if stamp <= 0:
            return self._by_arrival(received)
        base = self._base
        if base is None:
            if not self._begun:
                return self._begin(_Outlier(received, stamp), received - stamp, 1)
            return self._outlier(_Outlier(received, stamp))
        lag = received - stamp
        elapsed, before = received - self._received, self._line
        expected = before + self._rate * elapsed if elapsed > 0 else before
        if stamp < self._newest - self._tolerance or lag < expected - self._tolerance:
            return self._outlier(_Outlier(received, stamp))
        if stamp != self._stamp:
            self._stamp, self._repeats, self._repeated = stamp, 0, received
            if stamp > self._newest:
                self._newest = stamp
        else:
            self._repeats += 1
            if self._repeats >= _MAX_REPEATS and received - self._repeated >= _SECOND_US:
                self._base = None
                return self._by_arrival(received)
        if self._outliers:
            self._outliers.clear()
        support = self.support
        self.support = support + 1
        self._lag = self._last_lags[support % _LAST_LAGS] = lag
        begun, _, least, _ = self._least
        if self.brief or received >= begun + _PIECE_US or elapsed < 0:
            self._follow(received, lag, expected)
            self.skew = round(self._line) - self._delay - base
        else:
            # As ``_follow``, for most messages.
            self._received = received
            line = float(lag) if lag < expected else expected
            if line != before:
                self._line = line
                self.skew = round(line) - self._delay - base
            if lag < least:
                self._least = Piece(begun, received, lag, lag - line)
        # As TrackTime(…), in half the time.
        return tuple.__new__(TrackTime, (stamp + base, True))

    def reads(self, received: int, stamp: int) -> int:
        """Return when the content of another message of this sender was true, on the companion's clock.

        The message arrived at ``received`` with ``stamp`` (0: none). The estimate of the clock does not
        change.
        """
        if stamp <= 0 or self._base is None:
            return received - self._delay
        measured = self._measured
        if measured is None or self.brief or not self._holds(received, measured):
            return min(stamp + self._base + self.skew, received - self._delay)
        return min(stamp + measured.offset, received - measured.delay)

    def _holds(self, now: int, measured: _Measured) -> bool:
        """Return whether an offset still holds at ``now`` (µs).

        A message that would be from the future shows that the clock was set forward since.
        """
        age = now - measured.at
        return 0 <= age < _ANSWER_VALID_US and measured.offset <= self._lag + _AGEING * age

    def ahead(self, received: int, stamp: int) -> int:
        """Return by how much (µs) ``stamp`` is later than a message that arrived at ``received`` can be.

        Negative for an earlier one; 0 without a stamp or before the first message.
        """
        if stamp <= 0 or self._base is None:
            return 0
        return stamp + self._base + self.skew - (received - self._delay)

    @property
    def late(self) -> int:
        """Delay (µs) of the fastest of the last few messages above the line; 0 for a ``brief`` clock."""
        if self.brief or self._base is None or not self._last_lags:
            return 0
        return max(0, min(self._last_lags) - round(self._line))

    def answered(self, received: int, asked: int, stamp: int) -> None:
        """Record that the sender's clock showed ``stamp`` between ``asked`` and ``received``.

        ``asked`` and ``received`` are on the companion's clock; the stamp comes from the answer to a request.
        An answer from another clock than that of the messages is ignored; so is any while the clock is
        ``brief`` or the stamps are unusable.
        """
        if self.brief or self._base is None or not 0 < asked <= received:
            return
        if abs(received - stamp - self._lag) > self._tolerance:
            return
        self._answered = received
        self._measure(received, asked - stamp)
        received = max(received, self._received)
        line = self._line + self._rate * (received - self._received)
        # A message dated by this line gets the age that it would have if the request had taken no time: the
        # largest possible one. The line is not set above the last lags: no message is younger than the least
        # delay.
        least = min(asked - stamp + self._delay, *self._last_lags)
        if least > line:
            self.lost += round(least - line)
            self._received, self._line, self._rate = received, float(least), _DRIFT
            self._forget()
            self.skew = least - self._delay - self._base

    def _measure(self, received: int, least: int) -> None:
        """Measure the offset, which is at least ``least`` (µs), by an answer that came at ``received`` (µs).

        The measurement before counts on while it is better, and agrees with this one.
        """
        most, last = self._lag, self._measured
        if most < least - _ROUNDED_US:
            return
        delay = max(most - least, 0) // 2
        agrees = last is not None and least <= last.offset <= most
        if last is None or not agrees or last.delay + _AGEING * (received - last.at) >= delay:
            self._measured = _Measured(least + delay, delay, received)

    def _forget(self) -> None:
        """Discard the lags so far: they belong to another line."""
        self._pieces.clear()
        received, lag = self._received, self._lag
        self._least = Piece(received, received, lag, max(lag - self._line, 0.0))

    def _by_arrival(self, received: int) -> TrackTime:
        """Return the track time of a message without a usable stamp."""
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
        self._answered, self._measured, self._lag = None, None, lag
        self._last_lags = [lag] * _LAST_LAGS
        self._received, self._line, self._rate = received, float(lag), 0.0
        self._pieces.clear()
        self._least = Piece(received, received, lag, 0.0)
        self.support = support
        return TrackTime(stamp + self._base, True)

    def _outlier(self, new: _Outlier) -> TrackTime | None:
        """Date a message off the line; return None if it cannot be dated.

        Enough such messages that agree define a new line. If such messages contradict each other for a
        second the stamps count as unusable, and messages are dated by their arrival.
        """
        outliers = self._outliers
        if not outliers:
            self._first_outlier_at = new.received
        elif new.stamp <= outliers[-1].stamp or abs(new.lag - outliers[-1].lag) > self._tolerance:
            # No running clock gives these two stamps in succession.
            outliers.clear()
            if new.received - self._first_outlier_at >= _SECOND_US:
                self._base = None
        outliers.append(new)
        first, count = outliers[0], len(outliers)
        if count > _MIN_OUTLIERS:
            del outliers[1]
        lasted = new.received - first.received
        # A lag that is much smaller cannot be a delay, however its messages arrived.
        ahead = self._base is not None and new.lag < self._line - self._tolerance
        live = lasted >= _SECOND_US and lasted >= _MIN_ARRIVAL_RATIO * (new.stamp - first.stamp)
        if count >= _MIN_OUTLIERS and (ahead or live):
            return self._begin(new, min(outlier.lag for outlier in outliers), count)
        return self._by_arrival(new.received) if self._base is None else None

    def _follow(self, received: int, lag: int, expected: float) -> None:
        """Keep the line at or below the lags; at the end of each piece, check whether it may be raised."""
        if self.brief:
            self._received, self._line, self._rate = received, float(min(self._last_lags)), 0.0
            return
        if received > self._received:
            self._received = received
        else:
            received = self._received
        self._line = line = float(lag) if lag < expected else expected
        least = self._least
        if received < least.begun + _PIECE_US:
            if lag < least.lag:
                self._least = Piece(least.begun, received, lag, lag - line)
            return
        self._pieces.append(least)
        self._raise(received)
        self._line = line = min(float(lag), self._line)
        self._least = Piece(received, received, lag, lag - line)

    def _raise(self, received: int) -> None:
        """Raise the line at the end of a piece if the kept pieces allow it, and set its rate."""
        pieces = self._pieces
        if self._answered is not None and received - self._answered <= _ANSWER_VALID_US:
            self._rate = _DRIFT
            self._forget()
            return
        if len(pieces) == 1:
            # During the first piece the line is kept level; the drift of this time is added here.
            self._line += _DRIFT * (received - pieces[0].received)
        last = recent(pieces)
        learnt = steady_rate(last)
        self._rate = _DRIFT + learnt
        if learnt > 0.0:
            # A delay above the line at the beginning of these pieces still counts as age.
            self._line = max(self._line, line_below(last, self._rate, received) - last[0].above)
        if len(pieces) == MAX_PIECES:
            youngest = line_below(pieces, _DRIFT, received)
            if youngest > self._line + _UNUSABLE_US:
                self._line = youngest
