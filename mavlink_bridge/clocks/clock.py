"""Sources of the current time in integer µs, simulated or real.

Loops and links read a clock; nodes receive the time as an argument.
"""

from __future__ import annotations

import time
from typing import Protocol

from mavlink_bridge.clocks.node_clock import NodeClock


class Clock(Protocol):
    """Time in integer µs that never decreases."""

    def now(self) -> int:
        """Return the current time, µs."""
        ...

    def wait_until(self, instant: int) -> None:
        """Block until ``now() >= instant``; return at once if ``instant`` (µs) is past."""
        ...


class SimulatedClock:
    """Clock that stands still between calls of ``wait_until``, then jumps."""

    def __init__(self, start: int = 0) -> None:
        self._now = start

    def now(self) -> int:
        """Return the latest instant waited for, or the start, µs."""
        return self._now

    def wait_until(self, instant: int) -> None:
        """Jump to ``instant``; never backwards."""
        self._now = max(self._now, instant)


class WallClock:
    """Unix time in µs, read once and then continued on the monotonic clock.

    A correction of the host's time therefore causes no jump.

    Two WallClocks of one host with the same ``offset_ns`` agree exactly, also in different processes, because
    they share the monotonic clock. An ``offset_ns`` other than the default moves time 0 away from the Unix
    epoch.
    """

    def __init__(self, offset_ns: int | None = None) -> None:
        self.offset_ns = time.time_ns() - time.monotonic_ns() if offset_ns is None else offset_ns
        """This clock minus the monotonic clock, ns."""

    def now(self) -> int:
        """Return Unix time (time since 0 of this clock, with a given ``offset_ns``), µs."""
        return (time.monotonic_ns() + self.offset_ns) // 1000

    def wait_until(self, instant: int) -> None:
        """Sleep until ``instant`` (Unix µs), without spinning.

        Spinning would take CPU time from other processes. ``time.sleep`` converts the duration to an absolute
        instant at once, so that a preemption within the call does not prolong the sleep.
        """
        while (left := instant - self.now()) > 0:
            time.sleep(left * 1e-6)


class LostTime(Protocol):
    """Account of the simulated time that was given up: ``lost``, µs.

    All clocks that shall show the same time share one account.
    """

    lost: int


class _PrivateAccount:
    lost = 0


class PacedClock:
    """Simulated time: from 0 on, ``speed`` times as fast as ``clock``.

    Between two waits it advances by at most ``stride`` (µs). If its user is slower, the rest of the time is
    given up and counted in ``lost`` (µs), so that the user is never more than one stride behind.

    Clocks in several processes show the same time if they share an ``account``: time that one of them gives
    up is given up for all, and a clock that is ahead stands still until the others catch up. None: the clock
    has an account of its own.
    """

    def __init__(self, clock: Clock, speed: float, stride: int, account: LostTime | None = None) -> None:
        self._clock, self._speed, self._stride = clock, speed, stride
        self._start = clock.now()
        self._limit = stride
        self._latest = 0
        self._account: LostTime = _PrivateAccount() if account is None else account

    @property
    def start(self) -> int:
        """Time of ``clock`` at simulated time 0, µs."""
        return self._start

    @property
    def lost(self) -> int:
        """Simulated time given up by all clocks of the account, µs."""
        return self._account.lost

    def now(self) -> int:
        """Return simulated time, µs."""
        passed = int((self._clock.now() - self._start) * self._speed)
        shown = passed - self._account.lost
        if shown > self._limit:
            # Assigned, not incremented: with increments two processes could count the same time twice.
            self._account.lost = passed - self._limit
            shown = self._limit
        self._latest = max(self._latest, shown)
        return self._latest

    def wait_until(self, instant: int) -> None:
        """Wait until simulated time is ``instant`` (µs)."""
        self._limit = max(self._limit, instant + self._stride)
        while self.now() < instant:
            # Repeated, because time given up during the wait postpones ``instant``; 1 µs more for rounding.
            lost = self._account.lost
            self._clock.wait_until(self._start + int((instant + lost) / self._speed) + 1)
        self._limit = self.now() + self._stride


class SkewedClock:
    """Clock with an error: ``skew`` applied to the time of the true ``clock``."""

    def __init__(self, clock: Clock, skew: NodeClock) -> None:
        self._clock, self._skew = clock, skew

    def now(self) -> int:
        """Return the time that the skewed clock shows, µs."""
        return self._skew.reading(self._clock.now())

    def wait_until(self, instant: int) -> None:
        """Wait until the skewed clock shows ``instant`` (µs)."""
        self._clock.wait_until(self._skew.instant(instant))
