"""Drift of a vehicle that its autopilot takes off or lands: how far it is from the axis of its column."""

from __future__ import annotations

from math import hypot

from companion.values.horizon import Array
from companion.values.phase import Phase


class DriftMeter:
    """Meter of the largest horizontal distance (m) from where a take-off or a landing began.

    ``largest``: None before the first take-off.
    """

    def __init__(self) -> None:
        self._phase: Phase | None = None
        self._place: tuple[float, float] | None = None
        self.largest: float | None = None

    def see(self, phase: Phase, position: Array) -> None:
        """Take note of the vehicle's ``position`` (3,), m, in a ``phase`` of its flight."""
        begins, self._phase = phase is not self._phase, phase
        if phase not in (Phase.PREPARE, Phase.LAND):
            return
        x, y, _ = position
        if begins or self._place is None:
            self._place = float(x), float(y)
        away = hypot(x - self._place[0], y - self._place[1])
        self.largest = max(self.largest or 0.0, away)
