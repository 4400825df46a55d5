"""Effects of a loss and of a jump of GPS on an estimate, as in ArduPilot's EKF3 and PX4's EKF2.

*Loss*: the filter coasts on its accelerometers, and its horizontal error grows with the square of time; the
barometer keeps the height. The filter reports nothing while it trusts itself (EKF3: 7 s without position,
posRetryTimeNoVel; EKF2: EKF2_NOAID_TOUT 5 s); then it has no position any more. If GPS returns before that,
the error is filtered away; later the filter resets to GPS in one jump.

*Jump*: within the gate the filter follows it at its own pace. Beyond the gate the filter rejects GPS, and
resets to it after 7 s (both filters), with a jump of the estimate. The velocity of GPS is not shifted, so the
estimated velocity is not either.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mavlink_bridge.messages import Vector
from sitl.values.setpoints import ZERO

# σ of the acceleration error while coasting (m/s²): residual bias and tilt of the filter.
_COASTING: Final = 0.05
# Time constant with which a filter follows GPS (s).
_PACE: Final = 1.0
# Innovation gate: 5 σ (EKF2_GPS_P_GATE) of 0.5 m GPS and as much of the filter's own (m).
_GATE: Final = 3.5
# Time after which a filter resets to rejected GPS (s); EKF3's posRetryTimeNoVel and EKF2's reset_timeout_max
# are the same.
_GIVES_IN: Final = 7.0
# Error below which a fault counts as over (m, m/s).
_NOTHING: Final = 1e-4


class Positioning:
    """Part of an estimate's error that GPS causes, advanced in steps of ``dt`` seconds.

    ``position`` and ``velocity`` (m, m/s, local NED) are that error; ``located``: whether the filter reports
    a position; ``fixed``: whether there is GPS; ``resets`` counts the jumps of the estimate; ``nominal``: no
    fault has any effect now. ``strain``: innovation of a position over its gate; from 1 on GPS is rejected.
    ``spread``: σ (m) that coasting has added so far, as estimated by the filter.
    """

    def __init__(self, patience: float, dt: float, random: np.random.Generator) -> None:
        """``patience`` (s): how long the filter coasts before it has no position."""
        self._patience, self._dt, self._random = patience, dt, random
        self._keep = math.exp(-dt / _PACE)
        self._goes = False
        self._target = ZERO
        self._offset = ZERO
        self._drift = (0.0, 0.0)
        self._speed = (0.0, 0.0)
        self._push = (0.0, 0.0)
        self._coasted = self._refused = self._gap = 0.0
        self.fixed = True
        self.located = True
        self.nominal = True
        self.resets = 0

    @property
    def position(self) -> Vector:
        """Error of the position (m, local NED)."""
        x, y, z = self._offset
        return x + self._drift[0], y + self._drift[1], z

    @property
    def velocity(self) -> Vector:
        """Error of the velocity (m/s, local NED)."""
        return self._speed[0], self._speed[1], 0.0

    @property
    def strain(self) -> float:
        """Innovation of a position over its gate; from 1 on GPS is rejected."""
        return 0.0 if self.nominal or self._goes else self._gap / _GATE

    @property
    def spread(self) -> float:
        """σ (m) that coasting has added so far, as estimated by the filter."""
        return 0.0 if self.fixed else 0.5 * _COASTING * self._coasted**2

    # Faults of GPS, effective from the next step on

    def lose(self) -> None:
        """Stop GPS."""
        self._goes, self.nominal = True, False

    def regain(self) -> None:
        """Restore GPS."""
        self._goes = False

    def shift(self, offset: Vector) -> None:
        """Set the total GPS error to ``offset`` (m, local NED); zero ends it."""
        self._target, self.nominal = offset, False

    def step(self) -> None:
        """Advance by one step of ``dt``."""
        if self.nominal:
            return
        if self._goes:
            self._coast()
        else:
            self._return()
            self._follow()
        quiet = self.fixed and self._target == ZERO == self._offset
        self.nominal = quiet and self._drift == (0.0, 0.0) == self._speed

    def _coast(self) -> None:
        if self.fixed:
            self.fixed = False
            self._coasted = 0.0
            north, east = (_COASTING * self._random.standard_normal(2)).tolist()
            self._push = north, east
        dt = self._dt
        (x, y), (u, v), (a, b) = self._drift, self._speed, self._push
        self._drift = x + dt * (u + 0.5 * dt * a), y + dt * (v + 0.5 * dt * b)
        self._speed = u + dt * a, v + dt * b
        self._coasted += dt
        self.located = self._coasted < self._patience

    def _return(self) -> None:
        """Reduce the error left by coasting, or remove it with a reset."""
        self.fixed = True
        if not self.located:
            self.located = True
            self._reset()
            return
        if self._drift == (0.0, 0.0) == self._speed:
            return
        keep = self._keep
        (x, y), (u, v) = self._drift, self._speed
        self._drift, self._speed = (keep * x, keep * y), (keep * u, keep * v)
        if max(map(abs, (*self._drift, *self._speed))) < _NOTHING:
            self._drift = self._speed = (0.0, 0.0)

    def _follow(self) -> None:
        """Follow GPS, or reject it."""
        (gx, gy, gz), (x, y, z) = self._target, self._offset
        self._gap = gap = math.hypot(gx - x, gy - y, gz - z)
        if gap > _GATE:
            self._refused += self._dt
            if self._refused >= _GIVES_IN:
                self._reset()
            return
        self._refused = 0.0
        if gap < _NOTHING:
            self._offset = self._target
            return
        keep = self._keep
        self._offset = gx + keep * (x - gx), gy + keep * (y - gy), gz + keep * (z - gz)

    def _reset(self) -> None:
        self._offset = self._target
        self._drift = self._speed = (0.0, 0.0)
        self._refused = self._gap = 0.0
        self.resets += 1
