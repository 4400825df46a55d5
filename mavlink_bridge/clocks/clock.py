"""Sources of the current time in integer µs, simulated or real.

Only the loop that runs nodes reads a clock; nodes receive the time as an argument.
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
        """Return when ``now() >= instant``; at once if that is past."""
        ...


class SimulatedClock:
    """Clock that stands still between calls of ``wait_until``, then jumps."""

    def __init__(self, start: int = 0) -> None:
        self._now = start

    def now(self) -> int:
        """Return the instant last waited for, µs."""
        return self._now

    def wait_until(self, instant: int) -> None:
        """Jump to ``instant``; never backwards."""
        self._now = max(self._now, instant)


class WallClock:
    """Unix time in µs, read once and then continued on the monotonic clock.

    A correction of the host's time therefore causes no jump.

    With the ``offset_ns`` of another WallClock of this host the two agree exactly, across processes too,
    because the monotonic clock is the same for all. A different ``offset_ns`` puts time 0 elsewhere.
    """

    def __init__(self, offset_ns: int | None = None) -> None:
        self.offset_ns = time.time_ns() - time.monotonic_ns() if offset_ns is None else offset_ns
        """This clock minus the monotonic clock, ns."""

    def now(self) -> int:
        """Return Unix time, µs."""
        return (time.monotonic_ns() + self.offset_ns) // 1000

    def wait_until(self, instant: int) -> None:
        """Sleep until ``instant`` (Unix µs), without spinning.

        Spinning would take time from others on a shared machine. ``time.sleep`` waits for an absolute
        instant, so that the time spent before it begins is no delay.
        """
        while (left := instant - self.now()) > 0:
            time.sleep(left * 1e-6)


class LostTime(Protocol):
    """Shared record of the simulated time that is given up: ``lost``, µs.

    All clocks that show the same time share one account.
    """

    lost: int


class _Own:
    lost = 0


class PacedClock:
    """Simulated time: from 0 on, ``speed`` times as fast as ``clock``.

    Between two waits it advances by at most ``stride`` (µs). Time that the user of the clock cannot keep up
    with is given up and counted in ``lost`` (µs), so that there is never more than one stride to catch up
    with.

    Copies in several processes show one time as long as they share an ``account``: what one of them gives up
    is given up for all, and those that are ahead then wait for the others. None: the clock has an account of
    its own.
    """

    def __init__(self, clock: Clock, speed: float, stride: int, account: LostTime | None = None) -> None:
        self._clock, self._speed, self._stride = clock, speed, stride
        self._start = clock.now()
        self._most = stride
        self._latest = 0
        self._account: LostTime = _Own() if account is None else account

    @property
    def start(self) -> int:
        """Time that ``clock`` showed at 0, µs."""
        return self._start

    @property
    def lost(self) -> int:
        """Time given up, by all clocks of the account, µs."""
        return self._account.lost

    def now(self) -> int:
        """Return simulated time, µs."""
        passed = int((self._clock.now() - self._start) * self._speed)
        shown = passed - self._account.lost
        if shown > self._most:
            # Assigned, never incremented: two of several processes would book the same time twice.
            self._account.lost = passed - self._most
            shown = self._most
        self._latest = max(self._latest, shown)
        return self._latest

    def wait_until(self, instant: int) -> None:
        """Wait until simulated time is ``instant`` (µs)."""
        self._most = max(self._most, instant + self._stride)
        while self.now() < instant:
            # In a loop, because time that is lost meanwhile makes it later; 1 µs more, for the rounding.
            lost = self._account.lost
            self._clock.wait_until(self._start + int((instant + lost) / self._speed) + 1)
        self._most = self.now() + self._stride


class SkewedClock:
    """Clock of a computer with an error: ``skew`` applied to what the true ``clock`` shows."""

    def __init__(self, clock: Clock, skew: NodeClock) -> None:
        self._clock, self._skew = clock, skew

    def now(self) -> int:
        """Return the time that the skewed clock shows, µs."""
        return self._skew.reading(self._clock.now())

    def wait_until(self, instant: int) -> None:
        """Wait until the skewed clock shows ``instant`` (µs)."""
        self._clock.wait_until(self._skew.instant(instant))
