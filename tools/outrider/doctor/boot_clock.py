"""Clock of a vehicle (time_boot), compared with the receiver's clock."""

from __future__ import annotations

from typing import Final

from mavlink_bridge.messages import Message

_MIN_RESTART_US: Final = 1_000_000
_MIN_LEAP_US: Final = 5_000_000
_MAX_SPEED_UP: Final = 100
"""Assumed largest factor by which a simulation is faster than real time."""


class BootClock:
    """Comparison of a vehicle's clock with the receiver's, fed with pairs of times.

    ``stamps``: number of time stamps. ``restarts``: number of times the vehicle's clock went back by more
    than a second. ``backward``: number of stamps at which it went back at all, or at which two different
    messages had the same time. ``leaps``: number of times it went ahead by more than 5 s plus 100 times the
    time that passed for the receiver. Each message is compared with the previous one of its type.
    """

    def __init__(self) -> None:
        self.restarts = self.backward = self.leaps = self.stamps = 0
        self._before: dict[type, tuple[int, int, Message]] = {}
        self._start: tuple[int, int] | None = None
        self._end = (0, 0)

    def tell(self, now: int, message: Message, boot: int) -> None:
        """Add ``message``, which was received at ``now`` and has the time stamp ``boot`` (both µs)."""
        kind = type(message)
        self.stamps += 1
        before = self._before.get(kind)
        if before is not None:
            passed, gone = now - before[0], boot - before[1]
            restarted, leapt = gone < -_MIN_RESTART_US, gone > _MIN_LEAP_US + _MAX_SPEED_UP * passed
            self.backward += gone < 0 or (gone == 0 and message != before[2])
            self.restarts += restarted
            self.leaps += leapt
            if restarted or leapt:
                # The earlier stamps of other messages are from the old count: the same step would count
                # again.
                self._start = None
                self._before.clear()
        self._before[kind] = now, boot, message
        self._start = self._start or (now, boot)
        self._end = now, boot

    @property
    def seconds(self) -> float:
        """Time since the last restart or leap (s of the receiver's clock)."""
        return 0.0 if self._start is None else (self._end[0] - self._start[0]) * 1e-6

    @property
    def rate(self) -> float | None:
        """Rate of the clock since its last restart or leap: its seconds per second of the receiver's.

        None below 1 s, and for a rate that is not positive.
        """
        if self._start is None or self.seconds < 1.0:
            return None
        rate = (self._end[1] - self._start[1]) * 1e-6 / self.seconds
        return rate if rate > 0.0 else None

    @property
    def doubled(self) -> bool:
        """Whether the stamps come from two clocks: ``backward`` is ≥ 5 and ≥ 2 % of ``stamps``."""
        return self.backward >= 5 and self.backward >= 0.02 * self.stamps
