"""Clock of the autopilot's processor: the time since boot that it stamps messages with, and its UTC.

Both firmwares set UTC from GNSS and then let it run on the processor's oscillator: ArduPilot sets it forward
only, PX4 again when it is off by 5 s. So here UTC is set once, at the first fix, and drifts from then on.
"""

from __future__ import annotations

from mavlink_bridge.clocks.node_clock import NodeClock
from sitl.config.autopilot import AutopilotConfig


class OwnClock:
    """Clock of one autopilot. True times are µs since boot."""

    def __init__(self, config: AutopilotConfig) -> None:
        self._clock = NodeClock(drift_ppm=config.clock_drift_ppm)
        self._error = config.utc_error_us
        self._from_steps = config.epoch_from_steps
        self._set_at: int | None = None
        self.boot_epoch = config.epoch
        """Unix time of the boot, µs; 0: the autopilot never learns UTC."""

    def boot(self, first: int) -> None:
        """Boot in the step of the time ``first`` (µs)."""
        if self._from_steps:
            self.boot_epoch = first

    def locate(self, now: int) -> None:
        """Set UTC, which GNSS tells at ``now`` (µs), unless it has been set before."""
        if self._set_at is None:
            self._set_at = now

    def shift_utc(self, by: int) -> None:
        """Shift UTC by ``by`` (µs), as a receiver does that was wrong, or is now."""
        self._error += by

    def stamp(self, now: int) -> int:
        """Return the time since boot (µs) that the clock shows at ``now`` (µs)."""
        return self._clock.reading(now)

    @property
    def epoch(self) -> int:
        """UTC minus the clock's time since boot, µs; 0 while UTC is not known."""
        if self._set_at is None or not self.boot_epoch:
            return 0
        return self.boot_epoch + self._set_at - self.stamp(self._set_at) + self._error
