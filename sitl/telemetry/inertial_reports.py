"""Messages of the inertial sensors: RAW_IMU, HIGHRES_IMU, and the simulation's truth, SIMSTATE."""

from __future__ import annotations

import math
from typing import Final

from mavlink_bridge.messages import HighresImu, Message, RawImu, ScaledImu, ScaledPressure, SimState, Vector
from sitl.telemetry.reports import Snapshot
from sitl.values.attitudes import euler, quaternion, to_body

# Magnetic field, gauss, NED, as in Zurich.
_EARTH_FIELD: Final = (0.2155, 0.0120, 0.4240)
_SEA_LEVEL_HPA: Final = 1013.25
_SCALE_HEIGHT_M: Final = 8434.0
_TEMPERATURE_C: Final = 25.0


def raw_imu(s: Snapshot) -> Message:
    """Return RAW_IMU (27)."""
    return RawImu(s.source, s.time, _force(s), s.estimate.body_rates, _field(s))


def scaled_imu(s: Snapshot) -> Message:
    """Return SCALED_IMU (26)."""
    return ScaledImu(s.source, s.time, _force(s), s.estimate.body_rates, _field(s))


def scaled_pressure(s: Snapshot) -> Message:
    """Return SCALED_PRESSURE (29)."""
    return ScaledPressure(s.source, s.time, _pressure(s)[0], _TEMPERATURE_C)


def _pressure(s: Snapshot) -> tuple[float, float]:
    """Return the static pressure (hPa) and its altitude (m)."""
    altitude = s.origin.altitude - s.estimate.position[2]
    return _SEA_LEVEL_HPA * math.exp(-altitude / _SCALE_HEIGHT_M), altitude


def highres_imu(s: Snapshot) -> Message:
    """Return HIGHRES_IMU (105)."""
    pressure, altitude = _pressure(s)
    return HighresImu(
        s.source, s.time, _force(s), s.estimate.body_rates, _field(s), pressure, altitude, _TEMPERATURE_C
    )


def sim_state(s: Snapshot) -> Message:
    """Return SIMSTATE (164)."""
    truth = s.truth()
    w, x, y, z = truth.attitude.tolist()
    latitude, longitude, _ = s.origin.geodetic(s.origin.position_to_local(truth.position))
    p, q, r = truth.body_rates.tolist()
    # Attitude relative to site NED: its rotation against local NED, 0.16 mrad per km, is neglected.
    return SimState(s.source, *euler((w, x, y, z)), _force(s), (p, q, r), latitude, longitude)


def _force(s: Snapshot) -> Vector:
    """Return the specific force (m/s², FRD) of the rotors or of the ground, along the body's z axis.

    Drag, at most a tenth of it, is neglected.
    """
    return 0.0, 0.0, -s.lift()


def _field(s: Snapshot) -> Vector:
    """Return the magnetic field (gauss, FRD)."""
    e = s.estimate
    return to_body(quaternion(e.roll, e.pitch, e.yaw), _EARTH_FIELD)
