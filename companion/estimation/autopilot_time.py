"""UTC of the autopilot on the own clock: SYSTEM_TIME (2), carried over by TIMESYNC (111).

SYSTEM_TIME gives UTC and the time since boot at one instant, so its own delay does not matter. TIMESYNC gives
the time since boot on the own clock, within the round trip. Neither firmware bounds the error of its UTC:
ArduPilot sets it once and afterwards only forward, PX4 sets it again when it is off by 5 s; in between it
runs on the autopilot's oscillator. So its error when it was set is a setting, and a drift from the boot on is
added.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from companion.config.certified import TimeSourcesConfig
from companion.estimation.fleet_time import Offset
from mavlink_bridge.messages import Source, SystemTime, Timesync

_PERIOD_US = 500_000
"""Time between two requests, µs."""
_NS_PER_US = 1000
_MARK = 770
"""Last three digits of the time (ns) of a request, which tell it from others of this companion."""
_MAX_OPEN_REQUESTS = 32
_MAX_AGE_US = 10_000_000
"""Age (µs) from which SYSTEM_TIME and answers are not used any more."""
_EARLIEST_US, _LATEST_US = 1_577_836_800_000_000, 4_102_444_800_000_000
"""2020 and 2100, µs: an autopilot that does not know the time reports 0, or a date before."""
_MS_US = 1000
"""SYSTEM_TIME gives the time since boot in whole milliseconds, rounded down."""


class _Utc(NamedTuple):
    """``ahead``: UTC minus the time since ``boot`` (µs) of the message, which came at ``at`` (µs)."""

    ahead: int
    boot: int
    at: int


class AutopilotTime:
    """UTC of the autopilot for the companion ``own``."""

    def __init__(self, own: Source, config: TimeSourcesConfig) -> None:
        self._own, self._config = own, config
        self._next = 0
        self._asked: deque[int] = deque(maxlen=_MAX_OPEN_REQUESTS)
        self._utc: _Utc | None = None
        self._boot: Offset | None = None
        """Time since boot minus own time."""

    def due(self, now: int) -> list[Timesync]:
        """Return the request that is due at ``now`` (µs), if any."""
        if self._config.autopilot_us is None or now < self._next:
            return []
        self._next = now + _PERIOD_US
        question = now * _NS_PER_US + _MARK
        self._asked.append(question)
        return [Timesync(self._own, 0, question)]

    def receive(self, now: int, message: SystemTime | Timesync) -> None:
        """Receive a message of the own autopilot; TIMESYNC counts if it answers a request of ``due``."""
        if isinstance(message, SystemTime):
            self._receive_utc(now, message)
        elif message.tc1 > 0 and message.ts1 in self._asked:
            self._asked.remove(message.ts1)
            shown = message.tc1 // _NS_PER_US
            # The answer may have come after ``now``, the start of the step, but before it was read.
            least = shown - now - self._config.lateness_us
            self._receive_answer(Offset(least, shown + 1 - message.ts1 // _NS_PER_US, now))

    def offset(self, now: int) -> Offset | None:
        """Return by how much UTC is ahead of the own clock at ``now`` (µs); None if it is not known."""
        utc, boot, error = self._utc, self._boot, self._config.autopilot_us
        if utc is None or boot is None or error is None or now - min(utc.at, boot.at) > _MAX_AGE_US:
            return None
        boot = boot.aged(now, self._config.drift_ppm)
        since_boot = max(now + boot.most, 0)
        error += -(-since_boot * self._config.autopilot_drift_ppm // 1_000_000)
        return boot.shifted(utc.ahead - _MS_US - error, utc.ahead + error)

    def _receive_utc(self, now: int, message: SystemTime) -> None:
        if not _EARLIEST_US <= message.unix_time < _LATEST_US:
            self._utc = None
            return
        boot = self._boot
        restarted = self._utc is not None and message.time_boot < self._utc.boot
        if boot is not None and (
            restarted or message.time_boot > now + boot.aged(now, self._config.drift_ppm).most
        ):
            # The autopilot has another clock than that of the answers so far.
            self._boot = None
        self._utc = _Utc(message.unix_time - message.time_boot, message.time_boot, now)

    def _receive_answer(self, found: Offset) -> None:
        narrowed = found if self._boot is None else self._boot.narrowed(found, self._config.drift_ppm)
        if narrowed is None:
            # One of the clocks was set: what UTC was at a time since boot no longer holds.
            self._utc, narrowed = None, found
        self._boot = narrowed
