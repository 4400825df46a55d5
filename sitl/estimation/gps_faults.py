"""Effects of a loss and of a jump of GPS on an estimate, as in ArduPilot's EKF3 and PX4's EKF2.

*Loss*: the filter coasts on its accelerometers, and its horizontal error grows with the square of time; the
barometer keeps the height. The position is still reported as valid until a time limit (EKF3: 7 s,
posRetryTimeNoVel; EKF2: 5 s, EKF2_NOAID_TOUT), then as lost. If GPS returns within the limit, the error
decays with a time constant of 1 s; if later, the filter resets to GPS in one jump.

*Jump*: within the innovation gate the estimate follows GPS with a time constant of 1 s. Beyond the gate the
filter rejects GPS, and resets to GPS after 7 s (both filters), with a jump of the estimate. The velocity
measured by GPS is not shifted, so a jump adds no error to the estimated velocity.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mavlink_bridge.messages import Vector
from sitl.values.setpoints import ZERO

# σ of the acceleration error while coasting (m/s²): residual bias and tilt of the filter.
_ACCELERATION_SIGMA: Final = 0.05
# Low-pass time constant with which the estimate follows GPS (s).
_TIME_CONSTANT: Final = 1.0
# Innovation gate (m): 5 (EKF2_GPS_P_GATE) times σ of the innovation, √2 · 0.5 m: 0.5 m each of GPS and of the
# filter.
_GATE: Final = 3.5
# Time of rejected GPS before a filter resets to GPS (s): EKF3's posRetryTimeNoVel and EKF2's
# reset_timeout_max.
_RESET_TIMEOUT: Final = 7.0
# Error below which a fault counts as over (m, m/s).
_NEGLIGIBLE: Final = 1e-4


class Positioning:
    """Error of an estimate that is caused by faults of GPS, advanced in steps of ``dt`` seconds.

    ``position`` and ``velocity`` (m, m/s, local NED) are the error; ``located``: whether the filter reports
    its position as valid; ``fixed``: whether GPS was received in the last step; ``resets`` counts the jumps
    of the estimate; ``nominal``: no fault has any effect now. ``test_ratio``: innovation test ratio of the
    position (innovation over gate); GPS is rejected above 1. ``spread``: σ (m) of the position, as estimated
    by the filter, added since the loss of GPS; 0 with GPS.
    """

    def __init__(self, position_timeout: float, dt: float, random: np.random.Generator) -> None:
        """``position_timeout`` (s): time without GPS after which the position is reported as lost."""
        self._position_timeout, self._dt, self._random = position_timeout, dt, random
        self._decay = math.exp(-dt / _TIME_CONSTANT)
        self._lost = False
        self._gps_error = ZERO
        self._offset = ZERO
        self._coasting_error = (0.0, 0.0)
        self._velocity_error = (0.0, 0.0)
        self._acceleration_error = (0.0, 0.0)
        self._coasted = self._rejected_for = self._innovation = 0.0
        self.fixed = True
        self.located = True
        self.nominal = True
        self.resets = 0

    @property
    def position(self) -> Vector:
        """Error of the position (m, local NED)."""
        x, y, z = self._offset
        return x + self._coasting_error[0], y + self._coasting_error[1], z

    @property
    def velocity(self) -> Vector:
        """Error of the velocity (m/s, local NED)."""
        return self._velocity_error[0], self._velocity_error[1], 0.0

    @property
    def test_ratio(self) -> float:
        """Innovation test ratio of the position; GPS is rejected above 1. 0 without GPS."""
        return 0.0 if self.nominal or self._lost else self._innovation / _GATE

    @property
    def spread(self) -> float:
        """σ (m) of the position, as estimated by the filter, added since the loss of GPS; 0 with GPS."""
        return 0.0 if self.fixed else 0.5 * _ACCELERATION_SIGMA * self._coasted**2

    # Faults of GPS, effective from the next step on

    def lose(self) -> None:
        """Stop GPS."""
        self._lost, self.nominal = True, False

    def regain(self) -> None:
        """Restore GPS."""
        self._lost = False

    def shift(self, offset: Vector) -> None:
        """Set the error of GPS positions to ``offset`` (m, local NED); zero ends the fault."""
        self._gps_error, self.nominal = offset, False

    def step(self) -> None:
        """Advance by one step of ``dt``."""
        if self.nominal:
            return
        if self._lost:
            self._coast()
        else:
            self._return()
            self._follow()
        quiet = self.fixed and self._gps_error == ZERO == self._offset
        self.nominal = quiet and self._coasting_error == (0.0, 0.0) == self._velocity_error

    def _coast(self) -> None:
        if self.fixed:
            self.fixed = False
            self._coasted = 0.0
            north, east = (_ACCELERATION_SIGMA * self._random.standard_normal(2)).tolist()
            self._acceleration_error = north, east
        dt = self._dt
        (x, y), (u, v), (a, b) = self._coasting_error, self._velocity_error, self._acceleration_error
        self._coasting_error = x + dt * (u + 0.5 * dt * a), y + dt * (v + 0.5 * dt * b)
        self._velocity_error = u + dt * a, v + dt * b
        self._coasted += dt
        self.located = self._coasted < self._position_timeout

    def _return(self) -> None:
        """Let the error left by coasting decay, or remove it with a reset if the position was lost."""
        self.fixed = True
        if not self.located:
            self.located = True
            self._reset()
            return
        if self._coasting_error == (0.0, 0.0) == self._velocity_error:
            return
        decay = self._decay
        (x, y), (u, v) = self._coasting_error, self._velocity_error
        self._coasting_error, self._velocity_error = (decay * x, decay * y), (decay * u, decay * v)
        if max(map(abs, (*self._coasting_error, *self._velocity_error))) < _NEGLIGIBLE:
            self._coasting_error = self._velocity_error = (0.0, 0.0)

    def _follow(self) -> None:
        """Follow GPS, or reject GPS beyond the gate, for at most ``_RESET_TIMEOUT``."""
        (gx, gy, gz), (x, y, z) = self._gps_error, self._offset
        self._innovation = innovation = math.hypot(gx - x, gy - y, gz - z)
        if innovation > _GATE:
            self._rejected_for += self._dt
            if self._rejected_for >= _RESET_TIMEOUT:
                self._reset()
            return
        self._rejected_for = 0.0
        if innovation < _NEGLIGIBLE:
            self._offset = self._gps_error
            return
        decay = self._decay
        self._offset = gx + decay * (x - gx), gy + decay * (y - gy), gz + decay * (z - gz)

    def _reset(self) -> None:
        self._offset = self._gps_error
        self._coasting_error = self._velocity_error = (0.0, 0.0)
        self._rejected_for = self._innovation = 0.0
        self.resets += 1
