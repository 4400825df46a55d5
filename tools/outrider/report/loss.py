"""Lost messages of the swarm link, determined from the logs alone.

On each of its links a companion has one codec, which numbers the sent messages modulo 256 for all receivers
together. The numbers of a sender's messages on the swarm link are therefore consecutive in a receiver's log
if none is lost, and the sender's own log has every message that it sent. If both logs are available, messages
are compared byte by byte: the comparison is exact, and duplicates are not counted twice. For a sender without
a log (a moving obstacle, or a missing log) the gaps in its sequence numbers give the loss, from the first to
the last message that arrived.
"""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.report.run import Array, Log, Stream, Times

MODULO = 256
_MAX_TIME_S = 86_400.0
"""Limit of time (s) before and after the goal event: a damaged time stamp may have any value."""
_LONG_PAUSE_S = 2.0
"""Time (s) in which no sender sends 128 messages; in a longer pause, 256 numbers or more may be missing."""


class LossRate(NamedTuple):
    """Loss from one sender to one receiver (system ids): of ``sent`` messages ``lost`` did not arrive.

    ``exact`` is true if the sender's own log was used, and false if its sequence numbers were. The other
    values count from the goal event on, or from the start of the receiver's log if the goal event is not
    known: ``silence`` is the longest time (s) without an arrival before the sender's last message; ``usual``
    is the 95th percentile of the times (s) between arrivals. They are None if too few messages were sent or
    arrived.
    """

    sender: int
    receiver: int
    sent: int
    lost: int
    exact: bool
    silence: float | None
    usual: float | None

    @property
    def share(self) -> float:
        """Share of the messages that were lost, 0…1."""
        return self.lost / self.sent if self.sent else 0.0


class Losses(NamedTuple):
    """Losses of all pairs, sorted by sender and receiver.

    ``by_second`` (n,) is the share of messages lost in each second after ``since`` (s on the flight's clock),
    over all exact pairs; NaN in seconds without a sent message.
    """

    ways: tuple[LossRate, ...]
    since: int
    by_second: Array

    @property
    def share(self) -> float | None:
        """Share of all messages that were lost; None if no message was sent."""
        sent = sum(way.sent for way in self.ways)
        return sum(way.lost for way in self.ways) / sent if sent else None


class LossComparison:
    """Comparison of each sender's log with every receiver's log, as soon as both are available.

    The messages received from a sender are kept only until both logs are available, or to the end for a
    sender without a log, because in less than two minutes two hundred vehicles receive eighty million
    messages.
    """

    def __init__(self) -> None:
        self._logs: dict[int, _SenderLog] = {}
        self._waiting: dict[int, dict[int, list[Stream]]] = {}
        self._ways: list[LossRate] = []
        self._seconds = _Seconds()

    def take(self, log: Log, ahead: float | None = None) -> None:
        """Add the log of another owner; ``ahead`` is its clock's offset (s, ``clocks.offset``), if known."""
        ahead = 0.0 if ahead is None else ahead
        new = _SenderLog(log._replace(received={}), ahead, log.begin - 1e6 * min(0.0, ahead))
        waiting: dict[int, list[Stream]] = {}
        for sender, stream in log.received.items():
            waiting.setdefault(sender.system, []).append(stream)
        self._waiting[log.owner] = waiting
        for owner, other in self._logs.items():
            self._compare(other, new, waiting.pop(owner, []))
            self._compare(new, other, self._waiting[owner].pop(log.owner, []))
        self._logs[log.owner] = new

    def close(self) -> Losses:
        """Return the losses of all pairs of a sender and a vehicle with a log.

        Pairs without a message are omitted.
        """
        for owner, waiting in self._waiting.items():
            for system, streams in waiting.items():
                self._keep(_by_numbers(system, owner, streams, self._logs[owner].goal))
        self._ways.sort(key=lambda way: (way.sender, way.receiver))
        return Losses(tuple(self._ways), *self._seconds.shares())

    def _compare(self, sender: _SenderLog, receiver: _SenderLog, streams: list[Stream]) -> None:
        way, when, lost = _exact(sender.log, receiver.log, streams, receiver.goal)
        self._seconds.add(when * 1e-6 + sender.ahead, lost)
        self._keep(way)

    def _keep(self, way: LossRate) -> None:
        if way.sent:
            self._ways.append(way)


class _SenderLog(NamedTuple):
    """``log`` without received messages, the offset ``ahead`` of its clock (s), and ``goal`` (µs).

    ``goal`` is the time on the log's clock of the goal event, or of the start of the log if that is later.
    """

    log: Log
    ahead: float
    goal: float


class _Seconds:
    """Messages sent and lost in each second, added pair by pair."""

    def __init__(self) -> None:
        self._sent: Counter[int] = Counter()
        self._lost: Counter[int] = Counter()

    def add(self, ours: Array, lost: NDArray[np.bool_]) -> None:
        """Add messages sent at ``ours`` (n,), s on the flight's clock; ``lost`` (n,) marks the lost ones."""
        sane = np.abs(ours) < _MAX_TIME_S
        for counter, times in ((self._sent, ours[sane]), (self._lost, ours[sane & lost])):
            seconds, counts = np.unique(np.floor(times).astype(np.int64), return_counts=True)
            for second, count in zip(seconds.tolist(), counts.tolist(), strict=True):
                counter[second] += count

    def shares(self) -> tuple[int, Array]:
        """Return the first second, and the share lost in each second from there on."""
        if not self._sent:
            return 0, np.empty(0)
        first, last = min(self._sent), max(self._sent)
        sent, lost = (
            np.array([counter[second] for second in range(first, last + 1)])
            for counter in (self._sent, self._lost)
        )
        return first, np.where(sent > 0, lost / np.maximum(sent, 1), np.nan)


def _exact(
    sender: Log, receiver: Log, streams: list[Stream], goal: float
) -> tuple[LossRate, Array, NDArray[np.bool_]]:
    """Compare both logs; ``goal`` is µs on the receiver's clock.

    The second and the third value concern the n messages that count: the times (n,) of sending, µs since the
    start of the sender's log, and whether (n,) each message was lost.
    """
    ours, stream = sender.sent, _joined(streams)
    marks, first, copies = np.unique(stream.mark, return_index=True, return_counts=True)
    arrived = np.isin(ours.mark, marks)
    there = ours.time.astype(np.float64)
    counted = np.ones(len(there), dtype=bool)
    if arrived.any():
        # The clocks differ; messages in both logs give the difference. Messages sent before the receiver's
        # log begins or after it ends are not counted.
        place = np.searchsorted(marks, ours.mark[arrived])
        there += np.median(stream.time[first[place]] - ours.time[arrived])
        counted = (there >= receiver.begin) & (there <= receiver.end)
    # Equal bytes sent twice (a heartbeat some cycles of numbers later) must arrive twice.
    kinds, times_sent = np.unique(ours.mark[counted], return_counts=True)
    received = dict(zip(marks.tolist(), copies.tolist(), strict=True))
    came = np.array([received.get(kind, 0) for kind in kinds.tolist()], dtype=np.int64)
    lost = int(np.maximum(times_sent - came, 0).sum())
    silence, usual = _silences(stream.time[first], there[counted], goal)
    found = LossRate(sender.owner, receiver.owner, int(counted.sum()), lost, True, silence, usual)
    since = (ours.time - sender.begin)[counted].astype(np.float64)
    return found, since, ~arrived[counted]


def _by_numbers(system: int, receiver: int, streams: list[Stream], goal: float) -> LossRate:
    """Return the loss by the gaps in the sequence numbers of each component of ``system``."""
    sent = lost = 0
    for stream in streams:
        places = np.unique(unwrapped(stream))
        if len(places):
            span = int(places[-1] - places[0]) + 1
            sent, lost = sent + span, lost + span - len(places)
    times = _joined(streams).time
    silence, usual = _silences(times, times, goal)
    return LossRate(system, receiver, sent, lost, False, silence, usual)


def unwrapped(stream: Stream) -> Times:
    """Return the numbers (n,) of messages without the modulus of 256.

    Each step is taken as short as possible, also backwards, because messages overtake each other. After a
    long pause, as many cycles are added as the sender's usual rate implies.
    """
    if not len(stream.time):
        return np.empty(0, dtype=np.int64)
    numbers: Times = stream.sequence.astype(np.int64)
    steps = np.diff(numbers)
    steps = (steps + MODULO // 2) % MODULO - MODULO // 2
    waits = np.diff(stream.time) * 1e-6
    often = (waits >= 0.0) & (waits < _LONG_PAUSE_S)
    if waits[often].sum() > 0.0:
        rate = max(0.0, float(steps[often].sum() / waits[often].sum()))
        rounds = np.round((waits * rate - steps) / MODULO).astype(np.int64)
        steps = steps + np.where(often, 0, MODULO * np.maximum(rounds, 0))
    result: Times = np.concatenate([[0], np.cumsum(steps)])
    return result


def _joined(streams: list[Stream]) -> Stream:
    if not streams:
        nothing = np.empty(0, dtype=np.int64)
        return Stream(nothing, nothing.astype(np.uint8), nothing)
    return Stream(*(np.concatenate(column) for column in zip(*streams, strict=True)))


def _silences(
    arrivals: Array | Times, ours: Array | Times, since: float
) -> tuple[float | None, float | None]:
    """Return the longest time (s) without an arrival, and the 95th percentile of the times between arrivals.

    ``ours`` are the times of sending. Both values count from the first to the last message sent at ``since``
    or later. Times are µs on one clock. Both are None if no message was sent, and the percentile is None if
    fewer than two arrived.
    """
    ours = ours[ours >= since]
    if not len(ours):
        return None, None
    later = np.sort(arrivals[arrivals >= since])
    waits = np.diff(np.concatenate([ours[:1], later, ours[-1:]]).astype(np.float64)) * 1e-6
    usual = float(np.percentile(waits[1:-1], 95.0)) if len(waits) > 2 else None
    return max(0.0, float(waits.max())), usual
