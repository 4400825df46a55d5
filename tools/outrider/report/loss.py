"""Which messages of the swarm link did not arrive, from the logs alone.

On each of its links a companion has one codec, which numbers what it sends there modulo 256, whoever listens.
So the swarm link's numbers of a sender run through the logs of all others, and its own log has every message
that it told. Where both logs are there, messages are compared byte by byte: that is exact, and repeated ones
do not count twice. Of a sender without a log (a moving obstacle; a log that is lost) the gaps in its numbers
tell, from the first message that arrived to the last.
"""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.report.run import Array, Log, Stream, Times

MODULO = 256
_LONGEST = 86_400.0
"""s before and after the goal event: a damaged stamp may say anything."""
_PAUSE = 2.0
"""s: within so long nobody tells 128 messages; after longer, whole rounds of numbers may be missing."""


class Way(NamedTuple):
    """From one sender to one receiver (system ids): of ``sent`` messages ``lost`` did not arrive.

    ``exact``: by the sender's own log; otherwise by its sequence numbers. From the goal event on, if that is
    known: ``silence``, s of the longest time without a message until the sender told its last; ``usual``, s
    within which 95 % of the arrivals follow the one before; None where too little arrived.
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
        """Of messages that were lost, 0…1."""
        return self.lost / self.sent if self.sent else 0.0


class Losses(NamedTuple):
    """All ways, by sender and receiver; in the n seconds after ``since`` (s on the flight's clock) the share
    ``by_second`` (n,) of messages lost, over all exact ways; NaN where nobody spoke."""

    ways: tuple[Way, ...]
    since: int
    by_second: Array

    @property
    def share(self) -> float | None:
        """Of all messages that were lost; None if nobody spoke."""
        sent = sum(way.sent for way in self.ways)
        return sum(way.lost for way in self.ways) / sent if sent else None


class Ledger:
    """Each sender's own log is laid beside every receiver's as soon as both are there. What was heard of a
    sender is kept until then, and to the end of one without a log: two hundred vehicles hear eighty million
    messages in less than two minutes."""

    def __init__(self) -> None:
        self._logs: dict[int, _Party] = {}
        self._waiting: dict[int, dict[int, list[Stream]]] = {}
        self._ways: list[Way] = []
        self._seconds = _Seconds()

    def take(self, log: Log, ahead: float | None = None) -> None:
        """One more, of an owner that none was of; ``ahead`` of its clock, s (``clocks.offset``), if known."""
        ahead = 0.0 if ahead is None else ahead
        new = _Party(log._replace(heard={}), ahead, log.begin - 1e6 * min(0.0, ahead))
        waiting: dict[int, list[Stream]] = {}
        for sender, stream in log.heard.items():
            waiting.setdefault(sender.system, []).append(stream)
        self._waiting[log.owner] = waiting
        for owner, other in self._logs.items():
            self._compare(other, new, waiting.pop(owner, []))
            self._compare(new, other, self._waiting[owner].pop(log.owner, []))
        self._logs[log.owner] = new

    def close(self) -> Losses:
        """Of every sender that somebody heard or that has a log, to every log."""
        for owner, waiting in self._waiting.items():
            for system, streams in waiting.items():
                self._keep(_by_numbers(system, owner, streams, self._logs[owner].goal))
        self._ways.sort(key=lambda way: (way.sender, way.receiver))
        return Losses(tuple(self._ways), *self._seconds.shares())

    def _compare(self, sender: _Party, receiver: _Party, streams: list[Stream]) -> None:
        way, when, lost = _exact(sender.log, receiver.log, streams, receiver.goal)
        self._seconds.add(when * 1e-6 + sender.ahead, lost)
        self._keep(way)

    def _keep(self, way: Way) -> None:
        if way.sent:
            self._ways.append(way)


class _Party(NamedTuple):
    """``log`` without what was heard; ``ahead`` of its clock, s, and the goal event's µs on it."""

    log: Log
    ahead: float
    goal: float


class _Seconds:
    """Messages sent and lost in each second, way by way."""

    def __init__(self) -> None:
        self._sent: Counter[int] = Counter()
        self._lost: Counter[int] = Counter()

    def add(self, told: Array, lost: NDArray[np.bool_]) -> None:
        """When (n,) messages were told, s on the flight's clock, and whether (n,) they were lost."""
        sane = np.abs(told) < _LONGEST
        for counter, times in ((self._sent, told[sane]), (self._lost, told[sane & lost])):
            seconds, counts = np.unique(np.floor(times).astype(np.int64), return_counts=True)
            for second, count in zip(seconds.tolist(), counts.tolist(), strict=True):
                counter[second] += count

    def shares(self) -> tuple[int, Array]:
        """The first second, and the share lost in each from there on."""
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
) -> tuple[Way, Array, NDArray[np.bool_]]:
    """By both logs; ``goal`` is µs on the receiver's clock. With when (n,) each message was told, µs since
    the sender's log began, and whether (n,) it was lost."""
    told, heard = sender.told, _joined(streams)
    marks, first, copies = np.unique(heard.mark, return_index=True, return_counts=True)
    arrived = np.isin(told.mark, marks)
    there = told.time.astype(np.float64)
    counted = np.ones(len(there), dtype=bool)
    if arrived.any():
        # Clocks differ, so what both have tells by how much. Who was not there yet has lost nothing.
        place = np.searchsorted(marks, told.mark[arrived])
        there += np.median(heard.time[first[place]] - told.time[arrived])
        counted = (there >= receiver.begin) & (there <= receiver.end)
    # Equal bytes told twice (a heartbeat some rounds of numbers later) must arrive twice.
    kinds, times_told = np.unique(told.mark[counted], return_counts=True)
    received = dict(zip(marks.tolist(), copies.tolist(), strict=True))
    came = np.array([received.get(kind, 0) for kind in kinds.tolist()], dtype=np.int64)
    lost = int(np.maximum(times_told - came, 0).sum())
    silence, usual = _silences(heard.time[first], there[counted], goal)
    found = Way(sender.owner, receiver.owner, int(counted.sum()), lost, True, silence, usual)
    since = (told.time - sender.begin)[counted].astype(np.float64)
    return found, since, ~arrived[counted]


def _by_numbers(system: int, receiver: int, streams: list[Stream], goal: float) -> Way:
    """By the gaps in the numbers of each of its components."""
    sent = lost = 0
    for stream in streams:
        places = np.unique(unwrapped(stream))
        if len(places):
            span = int(places[-1] - places[0]) + 1
            sent, lost = sent + span, lost + span - len(places)
    times = _joined(streams).time
    silence, usual = _silences(times, times, goal)
    return Way(system, receiver, sent, lost, False, silence, usual)


def unwrapped(stream: Stream) -> Times:
    """Numbers (n,) of messages as if they were not modulo 256. A step is taken as short as it can be, back
    included, for messages overtake each other; after a long silence as many rounds are added as the sender's
    usual rate says."""
    if not len(stream.time):
        return np.empty(0, dtype=np.int64)
    numbers: Times = stream.sequence.astype(np.int64)
    steps = np.diff(numbers)
    steps = (steps + MODULO // 2) % MODULO - MODULO // 2
    waits = np.diff(stream.time) * 1e-6
    often = (waits >= 0.0) & (waits < _PAUSE)
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
    arrivals: Array | Times, told: Array | Times, since: float
) -> tuple[float | None, float | None]:
    """From ``since`` on: the longest time (s) without an arrival until the last that was ``told``, and what
    95 % of the arrivals keep. Times are µs on one clock."""
    told = told[told >= since]
    if not len(told):
        return None, None
    heard = np.sort(arrivals[arrivals >= since])
    waits = np.diff(np.concatenate([told[:1], heard, told[-1:]]).astype(np.float64)) * 1e-6
    usual = float(np.percentile(waits[1:-1], 95.0)) if len(waits) > 2 else None
    return max(0.0, float(waits.max())), usual
