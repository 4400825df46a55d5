"""Emulated system clock of a companion's computer, as a kernel reports it."""

from __future__ import annotations

from companion.node import Companion
from mavlink_bridge.clocks.node_clock import NodeClock
from mavlink_bridge.clocks.system_clock import SystemTimeReading

_KERNEL_PPM = 500
"""Rate at which the kernel lets the largest error grow after a correction."""
_CORRECTION_US = 16_000_000
"""Time (µs) between two corrections: 2⁴ s, the shortest common interval of NTP."""


class EmulatedSystemClock:
    """System clock that is disciplined: a ``SystemClock``.

    ``clock`` is the node's own clock from its start on; ``error`` (µs): by how much the system clock is ahead
    of UTC, within ``bound`` (µs).
    """

    def __init__(self, clock: NodeClock, error: int, bound: int) -> None:
        self._clock, self._error, self._bound = clock, error, bound

    def step(self, by: int) -> None:
        """Step by ``by`` (µs); the reported bound does not tell of it."""
        self._error += by

    def __call__(self, now: int) -> SystemTimeReading:
        """Return the reading at ``now`` (µs, the node's own clock)."""
        true = self._clock.instant(now)
        growth = (true - self._clock.since) % _CORRECTION_US * _KERNEL_PPM // 1_000_000
        # A node's time is rounded down to 4 µs.
        return SystemTimeReading(true + self._error - now, self._bound + growth + 4)


def step_clock(companion: Companion, by: int) -> None:
    """Let the system clock of ``companion`` step by ``by`` (µs), if there is one."""
    if isinstance(companion.system_clock, EmulatedSystemClock):
        companion.system_clock.step(by)
