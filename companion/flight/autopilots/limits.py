"""Limits of an autopilot, computed from its parameters.

How each firmware uses the parameters was read in the sources of ArduCopter 4.6.3 and PX4 1.16.1. ArduCopter
shapes every guided set-point: it bounds the acceleration with which it corrects position and velocity, and
the rate of change of the acceleration. PX4 in OFFBOARD bounds speed and tilt only: MPC_ACC_HOR and
MPC_JERK_MAX shape its own modes, and are used here as the limits for which the vehicle was set up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.flight.autopilots.px4 import PX4

_GRAVITY: Final = 9.80665
_CENTIDEGREE: Final = math.radians(0.01)


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of an autopilot that follows set-points, horizontal except ``climb`` and ``sink``.

    ``jerk`` (m/s³), ``acceleration`` (m/s²) and ``speed`` (m/s) bound norms; ``tilt`` (rad).
    ``position_gain`` and ``velocity_gain`` (1/s): of the position and velocity loops. ``climb`` and ``sink``
    (m/s): vertical speeds, both positive. ``shaped``: jerk and acceleration are enforced on set-points;
    otherwise only speeds and tilt are.
    """

    jerk: float
    acceleration: float
    speed: float
    tilt: float
    position_gain: float
    velocity_gain: float
    climb: float
    sink: float
    shaped: bool

    @property
    def tilt_acceleration(self) -> float:
        """Horizontal acceleration (m/s²) at the largest tilt, at constant height."""
        return _GRAVITY * math.tan(self.tilt)

    @property
    def usable_acceleration(self) -> float:
        """The lower of ``acceleration`` and the acceleration that the tilt allows (m/s²)."""
        return min(self.acceleration, self.tilt_acceleration)

    def stopping_distance(self, speed: float) -> float:
        """Return the distance (m) from ``speed`` (m/s) to rest within acceleration and jerk.

        The acceleration is zero at both ends. Returns infinity if one of the limits is 0.
        """
        acceleration, jerk = self.usable_acceleration, self.jerk
        if speed <= 0.0:
            return 0.0
        if min(acceleration, jerk) <= 0.0:
            return math.inf
        full = acceleration / jerk
        # The speed is point-symmetric about the middle of the stopping time.
        time = speed / acceleration + full if speed >= acceleration * full else 2.0 * math.sqrt(speed / jerk)
        return 0.5 * speed * time


_STOCK: Final[Mapping[int, Mapping[str, float]]] = MappingProxyType(
    {
        ARDUPILOT.autopilot: MappingProxyType(
            {
                "PSC_JERK_XY": 5.0,
                "WPNAV_ACCEL": 250.0,
                "WPNAV_SPEED": 1000.0,
                "ANGLE_MAX": 3000.0,
                "PSC_ANGLE_MAX": 0.0,
                "PSC_POSXY_P": 1.0,
                "PSC_VELXY_P": 2.0,
                "WPNAV_SPEED_UP": 250.0,
                "WPNAV_SPEED_DN": 150.0,
                "ATC_ACCEL_R_MAX": 110000.0,
                "ATC_ACCEL_P_MAX": 110000.0,
            }
        ),
        PX4.autopilot: MappingProxyType(
            {
                "MPC_JERK_MAX": 8.0,
                "MPC_ACC_HOR": 3.0,
                "MPC_XY_VEL_MAX": 12.0,
                "MPC_TILTMAX_AIR": 45.0,
                "MPC_XY_P": 0.95,
                "MPC_XY_VEL_P_ACC": 1.8,
                "MPC_Z_VEL_MAX_UP": 3.0,
                "MPC_Z_VEL_MAX_DN": 1.5,
            }
        ),
    }
)


def stock_parameters(autopilot: int) -> Mapping[str, float]:
    """Return the parameters that ``limits_of`` reads, with the firmware's defaults.

    Returns an empty mapping for an unknown MAV_AUTOPILOT.
    """
    return _STOCK.get(autopilot, MappingProxyType({}))


def limits_of(autopilot: int, parameters: Mapping[str, float]) -> Limits:
    """Return the limits of a vehicle with this MAV_AUTOPILOT and these parameters.

    A parameter that is missing or not finite has the stock value, so an empty mapping gives the stock
    firmware's limits. Raises KeyError for an unknown autopilot.
    """
    stock = _STOCK[autopilot]
    values = {name: _finite(parameters.get(name), usual) for name, usual in stock.items()}
    return _px4(values) if autopilot == PX4.autopilot else _ardupilot(values, stock)


def _ardupilot(values: Mapping[str, float], stock: Mapping[str, float]) -> Limits:
    # WPNAV_ACCEL of 0 or less means the firmware's default; PSC_ANGLE_MAX of 0 means ANGLE_MAX.
    acceleration = 0.01 * (values["WPNAV_ACCEL"] if values["WPNAV_ACCEL"] > 0.0 else stock["WPNAV_ACCEL"])
    own_tilt = values["PSC_ANGLE_MAX"]
    tilt = math.radians(own_tilt) if own_tilt > 0.0 else values["ANGLE_MAX"] * _CENTIDEGREE
    jerk = values["PSC_JERK_XY"]
    angular = min(values["ATC_ACCEL_R_MAX"], values["ATC_ACCEL_P_MAX"]) * _CENTIDEGREE
    if angular > 0.0:
        # Mean jerk that the angular acceleration allows on the way to the full acceleration. It is the lower
        # one where PSC_JERK_XY was raised and WPNAV_ACCEL was not.
        jerk = min(jerk, 0.5 * math.sqrt(acceleration * angular * _GRAVITY))
    return Limits(
        max(jerk, 0.0),
        acceleration,
        max(0.01 * values["WPNAV_SPEED"], 0.0),
        _tilt(tilt),
        max(values["PSC_POSXY_P"], 0.0),
        max(values["PSC_VELXY_P"], 0.0),
        max(0.01 * values["WPNAV_SPEED_UP"], 0.0),
        max(0.01 * values["WPNAV_SPEED_DN"], 0.0),
        shaped=True,
    )


def _px4(values: Mapping[str, float]) -> Limits:
    return Limits(
        max(values["MPC_JERK_MAX"], 0.0),
        max(values["MPC_ACC_HOR"], 0.0),
        max(values["MPC_XY_VEL_MAX"], 0.0),
        _tilt(math.radians(values["MPC_TILTMAX_AIR"])),
        max(values["MPC_XY_P"], 0.0),
        max(values["MPC_XY_VEL_P_ACC"], 0.0),
        max(values["MPC_Z_VEL_MAX_UP"], 0.0),
        max(values["MPC_Z_VEL_MAX_DN"], 0.0),
        shaped=False,
    )


_DECIDING: Final[Mapping[int, Mapping[str, tuple[str, ...]]]] = MappingProxyType(
    {
        ARDUPILOT.autopilot: MappingProxyType(
            {
                "jerk": ("PSC_JERK_XY", "ATC_ACCEL_R_MAX", "ATC_ACCEL_P_MAX"),
                "acceleration": ("WPNAV_ACCEL",),
                "speed": ("WPNAV_SPEED",),
                "tilt": ("ANGLE_MAX", "PSC_ANGLE_MAX"),
                "position_gain": ("PSC_POSXY_P",),
                "velocity_gain": ("PSC_VELXY_P",),
                "climb": ("WPNAV_SPEED_UP",),
                "sink": ("WPNAV_SPEED_DN",),
            }
        ),
        PX4.autopilot: MappingProxyType(
            {
                "jerk": ("MPC_JERK_MAX",),
                "acceleration": ("MPC_ACC_HOR",),
                "speed": ("MPC_XY_VEL_MAX",),
                "tilt": ("MPC_TILTMAX_AIR",),
                "position_gain": ("MPC_XY_P",),
                "velocity_gain": ("MPC_XY_VEL_P_ACC",),
                "climb": ("MPC_Z_VEL_MAX_UP",),
                "sink": ("MPC_Z_VEL_MAX_DN",),
            }
        ),
    }
)


def deciding(autopilot: int, parameters: Mapping[str, float], limit: str) -> tuple[str, float]:
    """Return name and value of the parameter that determines the field ``limit`` of ``limits_of``.

    If there are several, it is the one that gives the value nearest to the actual limit when all others are
    stock.
    """
    actual = getattr(limits_of(autopilot, parameters), limit)
    stock = _STOCK[autopilot]
    values = {name: _finite(parameters.get(name), stock[name]) for name in _DECIDING[autopilot][limit]}

    def off(name: str) -> float:
        return abs(float(getattr(limits_of(autopilot, {name: values[name]}), limit)) - float(actual))

    nearest = min(values, key=off)
    return nearest, values[nearest]


def _finite(value: float | None, usual: float) -> float:
    return usual if value is None or not math.isfinite(value) else value


def _tilt(angle: float) -> float:
    """Clamp a tilt (rad) to between level and 89°, the largest that PX4 allows."""
    return min(max(angle, 0.0), math.radians(89.0))


STOCK: Final[Mapping[int, Limits]] = MappingProxyType({number: limits_of(number, {}) for number in _STOCK})
"""Limits of the stock firmware, by MAV_AUTOPILOT."""
