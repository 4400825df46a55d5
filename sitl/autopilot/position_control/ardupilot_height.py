"""ArduCopter's vertical controller: desired height → climb rate → acceleration → thrust.

The velocity controller asks for an acceleration, and a PI controller of the *measured* acceleration moves the
throttle from that of hover. So about half of a change of the acceleration comes at once, and the rest within
a second, as the integral learns it. While the throttle is at a limit, the integral only decreases (AC_PID).
"""

from __future__ import annotations

import math
from typing import Final

from sitl.autopilot.position_control.airframe import GRAVITY, HOVER_THROTTLE
from sitl.autopilot.position_control.square_root import square_root_law
from sitl.config.gains import ArduPilotGains, Speeds

_PER_THROTTLE: Final = GRAVITY / HOVER_THROTTLE
"""Acceleration (m/s²) per throttle: AP_Motors makes the thrust proportional to it."""
_INTEGRAL_MAX: Final = 0.8 * _PER_THROTTLE
"""m/s²: PSC_ACCZ_IMX, 800 thousandths of the throttle."""
_PSC: Final = 0.1
"""Throttle per m/s², for a gain of 1: PSC_ACCZ_P and PSC_ACCZ_I count thousandths per cm/s²."""


class HeightControl:
    """Vertical controller with its filters and integral; z down."""

    def __init__(self, gains: ArduPilotGains, speeds: Speeds) -> None:
        self.configure(gains, speeds)
        self.restart()

    def configure(self, gains: ArduPilotGains, speeds: Speeds) -> None:
        """Use new parameters from now on."""
        self._gains = gains
        self._speeds = speeds

    def restart(self) -> None:
        """Begin in hover, with the integral reset."""
        self._velocity_error: float | None = None
        self._acceleration_error = 0.0
        self._integral = 0.0
        self._limited = False

    def advance(
        self,
        desired: tuple[float, float, float],
        actual: tuple[float, float, float],
        dt: float,
        highest: float,
    ) -> float:
        """Advance by ``dt`` seconds; return the acceleration (m/s²) that the throttle gives in the end.

        ``desired`` and ``actual``: position (m), velocity (m/s) and acceleration (m/s²) along z. ``highest``
        (m/s²): acceleration at full throttle; without throttle it is g.
        """
        gains, speeds = self._gains, self._speeds
        closing = square_root_law(desired[0] - actual[0], gains.position_z, gains.acceleration_z)
        closing = max(-speeds.up, min(speeds.down, closing))
        error = closing + desired[1] - actual[1]
        before = error if self._velocity_error is None else self._velocity_error
        self._velocity_error = velocity_error = before + _gain(gains.filter_z_hz, dt) * (error - before)
        error = gains.velocity_z * velocity_error + desired[2] - actual[2]
        self._acceleration_error += _gain(gains.throttle_filter_hz, dt) * (error - self._acceleration_error)
        error = _PSC * _PER_THROTTLE * self._acceleration_error
        if not self._limited or self._integral * error < 0.0:
            integral = self._integral + gains.throttle_integral * error * dt
            self._integral = max(-_INTEGRAL_MAX, min(_INTEGRAL_MAX, integral))
        down = gains.throttle * error + self._integral
        self._limited = not highest < down < GRAVITY
        return max(highest, min(GRAVITY, down))


def _gain(hz: float, dt: float) -> float:
    """Return the gain of a step of ``dt`` seconds of a first-order filter."""
    omega = 2.0 * math.pi * hz * dt
    return omega / (1.0 + omega)
