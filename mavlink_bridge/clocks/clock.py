"""Where *now* comes from: integer µs, simulated or real. Only the loop that runs nodes asks a clock; nodes
are told the time."""

from __future__ import annotations

import time
from typing import Protocol

from mavlink_bridge.clocks.node_clock import NodeClock


class Clock(Protocol):
    """Time in integer µs that never decreases."""

    def now(self) -> int:
        """The present, µs."""
        ...

    def wait_until(self, instant: int) -> None:
        """Return when ``now() >= instant``; at once if that is past."""
        ...


class SimulatedClock:
    """Stands still until it is told to go on, then jumps."""

    def __init__(self, start: int = 0) -> None:
        self._now = start

    def now(self) -> int:
        """The instant last waited for, µs."""
        return self._now

    def wait_until(self, instant: int) -> None:
        """Jump to ``instant``; never backwards."""
        self._now = max(self._now, instant)


class WallClock:
    """Unix time in µs, read once; from then on it runs on the monotonic clock, so that no correction of the
    host's time makes it jump.

    ``offset_ns`` of another WallClock of this host makes the two agree exactly, across processes too: the
    monotonic clock is the same for all. Time 0 may be put elsewhere with an ``offset_ns`` of one's own.
    """

    def __init__(self, offset_ns: int | None = None) -> None:
        self.offset_ns = time.time_ns() - time.monotonic_ns() if offset_ns is None else offset_ns
        """This clock minus the monotonic clock, ns."""

    def now(self) -> int:
        """Unix time, µs."""
        return (time.monotonic_ns() + self.offset_ns) // 1000

    def wait_until(self, instant: int) -> None:
        """Sleep until ``instant`` (Unix µs), never spinning: on a shared machine that would be others' time.

        ``time.sleep`` waits for an absolute instant, so that the time spent before it begins is no delay.
        """
        while (left := instant - self.now()) > 0:
            time.sleep(left * 1e-6)


class Account(Protocol):
    """Where simulated time is booked that is given up: ``lost``, µs. One for all who live in the same
    time."""

    lost: int


class _Own:
    lost = 0


class PacedClock:
    """Simulated time: from 0 on, ``speed`` times as fast as ``clock``. Between two waits it goes no further
    than ``stride`` (µs): what whoever runs by it cannot keep up with is given up, and counted in ``lost``
    (µs), so that nobody ever has to make up for more than a stride at once.

    Copies of it in several processes show one time as long as they share an ``account``: what one of them
    gives up is given up for all, and who is ahead then waits for the others. It is the clock's own if None.
    """

    def __init__(self, clock: Clock, speed: float, stride: int, account: Account | None = None) -> None:
        self._clock, self._speed, self._stride = clock, speed, stride
        self._start = clock.now()
        self._most = stride
        self._latest = 0
        self._account: Account = _Own() if account is None else account

    @property
    def start(self) -> int:
        """What ``clock`` showed at 0."""
        return self._start

    @property
    def lost(self) -> int:
        """µs given up, by all."""
        return self._account.lost

    def now(self) -> int:
        """Simulated time, µs."""
        passed = int((self._clock.now() - self._start) * self._speed)
        shown = passed - self._account.lost
        if shown > self._most:
            # Never added to: two of several processes would book the same time twice.
            self._account.lost = passed - self._most
            shown = self._most
        self._latest = max(self._latest, shown)
        return self._latest

    def wait_until(self, instant: int) -> None:
        """Until it is ``instant`` (µs, simulated)."""
        self._most = max(self._most, instant + self._stride)
        while self.now() < instant:
            # Again and again, as what is lost meanwhile makes it later; a µs more, for the rounding.
            lost = self._account.lost
            self._clock.wait_until(self._start + int((instant + lost) / self._speed) + 1)
        self._most = self.now() + self._stride


class SkewedClock:
    """The clock of a computer that is wrong: ``skew`` of what the true ``clock`` shows."""

    def __init__(self, clock: Clock, skew: NodeClock) -> None:
        self._clock, self._skew = clock, skew

    def now(self) -> int:
        """What it shows, µs."""
        return self._skew.reading(self._clock.now())

    def wait_until(self, instant: int) -> None:
        """Until it shows ``instant`` (µs)."""
        self._clock.wait_until(self._skew.instant(instant))
