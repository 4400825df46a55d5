"""Messages of vehicle status, which ground stations show beside the motion."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.messages.source import Source, Vector


class GpsRaw(NamedTuple):
    """GPS_RAW_INT (24).

    ``time`` µs since boot; ``hdop``, ``vdop`` dilutions; ``speed`` over ground and ``course`` (clockwise from
    north); the three accuracies in m, m and m/s, 0 when not known.
    """

    source: Source
    time: int
    fix_type: int
    latitude: float
    longitude: float
    altitude: float
    hdop: float | None
    vdop: float | None
    speed: float | None
    course: float | None
    satellites: int | None
    altitude_ellipsoid: float
    horizontal_accuracy: float
    vertical_accuracy: float
    speed_accuracy: float


class AttitudeQuaternion(NamedTuple):
    """ATTITUDE_QUATERNION (31): FRD body to local NED as (w, x, y, z); body rates (rad/s)."""

    source: Source
    time_boot: int
    attitude: tuple[float, float, float, float]
    body_rates: Vector


class VfrHud(NamedTuple):
    """VFR_HUD (74): speeds in m/s, altitude above mean sea level, ``heading`` 0…2π, ``throttle`` 0…1."""

    source: Source
    airspeed: float
    ground_speed: float
    altitude: float
    climb: float
    heading: float
    throttle: float


class Altitude(NamedTuple):
    """ALTITUDE (141): m; NaN for altitudes that are not measured; ``time`` µs since boot."""

    source: Source
    time: int
    monotonic: float
    above_sea: float
    local: float
    relative: float
    terrain: float
    clearance: float


class BatteryStatus(NamedTuple):
    """BATTERY_STATUS (147).

    ``voltages`` (V) of up to ten cells, or that of all in the first; ``current`` (A); ``consumed`` (A s);
    ``remaining`` 0…1; ``time_remaining`` (s, 0 when not known); ``charge_state`` is MAV_BATTERY_CHARGE_STATE.
    """

    source: Source
    id: int
    function: int
    type: int
    voltages: tuple[float, ...]
    current: float | None
    consumed: float | None
    remaining: float | None
    time_remaining: int
    charge_state: int


class EstimatorStatus(NamedTuple):
    """ESTIMATOR_STATUS (230).

    Ratios of innovations to their gates (below 1 is good, NaN not tested), accuracies (m),
    ESTIMATOR_STATUS_FLAGS. ``time`` µs since boot.
    """

    source: Source
    time: int
    velocity: float
    horizontal: float
    vertical: float
    magnetic: float
    above_ground: float
    airspeed: float
    horizontal_accuracy: float
    vertical_accuracy: float
    flags: int


class RawImu(NamedTuple):
    """RAW_IMU (27): specific force (m/s², FRD), body rates (rad/s) and magnetic field (gauss)."""

    source: Source
    time_boot: int
    specific_force: Vector
    body_rates: Vector
    magnetic_field: Vector


class HighresImu(NamedTuple):
    """HIGHRES_IMU (105): as RAW_IMU, plus static pressure (hPa), pressure altitude (m), temperature (°C)."""

    source: Source
    time_boot: int
    specific_force: Vector
    body_rates: Vector
    magnetic_field: Vector
    pressure: float
    pressure_altitude: float
    temperature: float


class SimState(NamedTuple):
    """SIMSTATE (164, ardupilotmega): ground truth of a simulation.

    Euler angles (rad), specific force (m/s², FRD), body rates (rad/s), degrees.
    """

    source: Source
    roll: float
    pitch: float
    yaw: float
    specific_force: Vector
    body_rates: Vector
    latitude: float
    longitude: float


class SimulationState(NamedTuple):
    """SIM_STATE (108): ground truth of a simulation, without time; ArduPilot's sends it on request.

    Degrees, altitude above mean sea level (m, float32), velocity (m/s).
    """

    source: Source
    latitude: float
    longitude: float
    altitude: float
    velocity_ned: Vector


class HilState(NamedTuple):
    """HIL_STATE_QUATERNION (115): ground truth of PX4's simulation in hardware (SIH).

    ``time`` µs since boot; velocity in steps of 1 cm/s.
    """

    source: Source
    time: int
    latitude: float
    longitude: float
    altitude: float
    velocity_ned: Vector
