"""What the loss of GPS and a jump of GPS do to an estimate, as ArduPilot's EKF3 and PX4's EKF2 do it.

*Loss*: the filter coasts on its accelerometers, and its horizontal error grows with the square of time; the
barometer keeps the height. Nothing is said about it for as long as the filter trusts itself (EKF3: 7 s
without position, posRetryTimeNoVel; EKF2: EKF2_NOAID_TOUT 5 s); then it has no position any more. When GPS
comes back in time the error is filtered away; later the filter resets to it in one jump.

*Jump*: within the gate it is followed at the filter's own pace. Beyond, GPS is refused, until the filter
gives in and resets to it after 7 s (both filters), with a jump of the estimate. Its velocity is not shifted,
so the estimated velocity is not either.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mavlink_bridge.messages import Vector
from sitl.values.setpoints import ZERO

# σ of the acceleration that is wrong while coasting (m/s²): bias and tilt that the filter has not found.
_COASTING: Final = 0.05
# How fast a filter follows GPS (s).
_PACE: Final = 1.0
# Innovation gate: 5 σ (EKF2_GPS_P_GATE) of 0.5 m GPS and as much of the filter's own (m).
_GATE: Final = 3.5
# s; EKF3's posRetryTimeNoVel and EKF2's reset_timeout_max are the same.
_GIVES_IN: Final = 7.0
# What is left of an error when it is over (m, m/s).
_NOTHING: Final = 1e-4


class Positioning:
    """The part of an estimate's error that GPS is to blame for, moved on in steps of ``dt`` seconds.

    ``position`` and ``velocity`` (m, m/s, local NED) are that error; ``located``: whether the filter says
    that it has a position; ``fixed``: whether there is GPS; ``resets`` counts the jumps of the estimate;
    ``nominal``: all of this is as if nothing had ever happened, until something does. ``strain``: innovation
    of a position over its gate; from 1 on GPS is refused. ``spread``: σ (m) of what coasting has added so
    far, as the filter itself sees it.
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
        x, y, z = self._offset
        return x + self._drift[0], y + self._drift[1], z

    @property
    def velocity(self) -> Vector:
        return self._speed[0], self._speed[1], 0.0

    @property
    def strain(self) -> float:
        return 0.0 if self.nominal or self._goes else self._gap / _GATE

    @property
    def spread(self) -> float:
        return 0.0 if self.fixed else 0.5 * _COASTING * self._coasted**2

    # What happens to GPS, from the next step on

    def lose(self) -> None:
        """No more GPS."""
        self._goes, self.nominal = True, False

    def regain(self) -> None:
        """GPS again."""
        self._goes = False

    def shift(self, offset: Vector) -> None:
        """GPS is off by ``offset`` (m, local NED) in all; zero ends it."""
        self._target, self.nominal = offset, False

    def step(self) -> None:
        """Move on by one step of time."""
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
        """Let what coasting left fade, or vanish with a reset."""
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
        """Go after GPS, or refuse to."""
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
