"""Clock of a companion's processes, and the system clock as a source of fleet time.

All processes of a companion read the same clock: Unix time at the start of the first one, continued on the
monotonic clock of the host.
"""

from __future__ import annotations

from mavlink_bridge.clocks.clock import Clock, SkewedClock, WallClock
from mavlink_bridge.clocks.node_clock import NodeClock
from mavlink_bridge.clocks.system_clock import KernelClock, SystemClock, SystemTimeReading
from outrider.scenarios.fly_config import ClockError


class CompanionClock:
    """Clock of a companion, with ``error`` if a test asks for one.

    ``clock`` is what its processes read; ``system_clock`` gives the kernel's clock relative to it. Objects of
    this class are made before the processes are forked, so that all have the same offset.
    """

    def __init__(self, error: ClockError | None = None, wall: WallClock | None = None) -> None:
        """Take ``wall``: the clock without the error, a new one by default."""
        self._wall = WallClock() if wall is None else wall
        self.clock: Clock = self._wall
        self._kernel: SystemClock = KernelClock(self._wall.offset_ns)
        if error is not None:
            skew = NodeClock(round(1000.0 * error.offset_ms), error.drift_ppm, self._wall.now())
            self.clock = SkewedClock(self._wall, skew)

    def system_clock(self, now: int) -> SystemTimeReading | None:
        """Return the system clock relative to ``clock``, at ``now`` (µs of that); a ``SystemClock``."""
        reading = self._kernel(now)
        if reading is None or self.clock is self._wall:
            return reading
        # The kernel's clock is read relative to the clock without the error.
        before = self._wall.now()
        ahead = self.clock.now() - before
        return SystemTimeReading(reading.ahead - ahead, reading.bound + self._wall.now() - before)
