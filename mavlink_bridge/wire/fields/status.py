"""Fields of the messages in ``messages.status``."""

from __future__ import annotations

from itertools import takewhile
from math import degrees, isfinite, radians, remainder, tau

from mavlink_bridge import messages as m
from mavlink_bridge.errors import EncodeError
from mavlink_bridge.wire.fields.units import (
    FULL_CIRCLE_CDEG,
    UNKNOWN_U16,
    Fields,
    degrees_e7,
    int16,
    on_globe,
)

_UNKNOWN_U8 = 0xFF
_CELLS = 10
_IDENTITY = (0.0, 0.0, 0.0, 0.0)
_AMPERE_SECONDS = 3.6  # ampere seconds in 1 mA h
_MILLI_G = 9.80665e-3
# Every field of HIGHRES_IMU.
_ALL_UPDATED = 0x1FFF


def _or_none(value: int, scale: float) -> float | None:
    return None if value == UNKNOWN_U16 else value / scale


def _or_unknown(name: str, value: float | None, scale: float) -> int:
    if value is None:
        return UNKNOWN_U16
    field = round(value * scale)
    if field == UNKNOWN_U16:
        raise EncodeError(f"{name} = {value} would read as unknown")
    return field


def gps_raw(s: m.Source, f: Fields) -> m.GpsRaw | None:
    """Decode GPS_RAW_INT; return None if a field is invalid."""
    time, latitude, longitude, altitude, hdop, vdop, speed, course, fix, satellites = f[:10]
    if not on_globe(latitude, longitude):
        return None
    return m.GpsRaw(
        s,
        time,
        fix,
        latitude / 1e7,
        longitude / 1e7,
        altitude / 1e3,
        _or_none(hdop, 1e2),
        _or_none(vdop, 1e2),
        _or_none(speed, 1e2),
        remainder(radians(course / 100), tau) if course <= FULL_CIRCLE_CDEG else None,
        None if satellites == _UNKNOWN_U8 else satellites,
        f[10] / 1e3,
        f[11] / 1e3,
        f[12] / 1e3,
        f[13] / 1e3,
    )


def gps_raw_fields(x: m.GpsRaw) -> Fields:
    """Encode GPS_RAW_INT; raise EncodeError for a value that does not fit."""
    return (
        x.time,
        degrees_e7("latitude", x.latitude, 90),
        degrees_e7("longitude", x.longitude, 180),
        round(x.altitude * 1e3),
        _or_unknown("hdop", x.hdop, 1e2),
        _or_unknown("vdop", x.vdop, 1e2),
        _or_unknown("speed", x.speed, 1e2),
        UNKNOWN_U16 if x.course is None else round(degrees(x.course) * 100) % FULL_CIRCLE_CDEG,
        x.fix_type,
        _UNKNOWN_U8 if x.satellites is None else x.satellites,
        round(x.altitude_ellipsoid * 1e3),
        round(x.horizontal_accuracy * 1e3),
        round(x.vertical_accuracy * 1e3),
        round(x.speed_accuracy * 1e3),
        0,
        0,
    )


def attitude_quaternion(s: m.Source, f: Fields) -> m.AttitudeQuaternion:
    """Decode ATTITUDE_QUATERNION."""
    return m.AttitudeQuaternion(s, f[0] * 1000, f[1:5], f[5:8])


def attitude_quaternion_fields(x: m.AttitudeQuaternion) -> Fields:
    """Encode ATTITUDE_QUATERNION."""
    return x.time_boot // 1000, *x.attitude, *x.body_rates, *_IDENTITY


def vfr_hud(s: m.Source, f: Fields) -> m.VfrHud:
    """Decode VFR_HUD."""
    airspeed, ground_speed, altitude, climb, heading, throttle = f
    return m.VfrHud(s, airspeed, ground_speed, altitude, climb, radians(heading % 360), throttle / 100)


def vfr_hud_fields(x: m.VfrHud) -> Fields:
    """Encode VFR_HUD."""
    heading = round(degrees(x.heading)) % 360
    return x.airspeed, x.ground_speed, x.altitude, x.climb, heading, round(x.throttle * 100)


def battery_status(s: m.Source, f: Fields) -> m.BatteryStatus:
    """Decode BATTERY_STATUS."""
    consumed, cells, current, remaining = f[0], f[3:13], f[13], f[17]
    voltages = tuple(cell / 1e3 for cell in takewhile(lambda cell: cell != UNKNOWN_U16, cells))
    return m.BatteryStatus(
        s,
        f[14],
        f[15],
        f[16],
        voltages,
        None if current == -1 else current / 100,
        None if consumed == -1 else consumed * _AMPERE_SECONDS,
        remaining / 100 if 0 <= remaining <= 100 else None,
        f[18],
        f[19],
    )


def battery_status_fields(x: m.BatteryStatus) -> Fields:
    """Encode BATTERY_STATUS; raise EncodeError for a value that does not fit."""
    if len(x.voltages) > _CELLS:
        raise EncodeError(f"BATTERY_STATUS: {len(x.voltages)} cells are more than {_CELLS}")
    cells = [_or_unknown("voltages", cell, 1e3) for cell in x.voltages]
    remaining = -1 if x.remaining is None else round(x.remaining * 100)
    if not -1 <= remaining <= 100:
        raise EncodeError(f"BATTERY_STATUS: remaining = {x.remaining} is outside 0…1")
    return (
        -1 if x.consumed is None else round(x.consumed / _AMPERE_SECONDS),
        -1,
        0x7FFF,
        *cells,
        *[UNKNOWN_U16] * (_CELLS - len(cells)),
        -1 if x.current is None else round(x.current * 100),
        x.id,
        x.function,
        x.type,
        remaining,
        x.time_remaining,
        x.charge_state,
        *[0] * 6,
    )


def raw_imu(s: m.Source, f: Fields) -> m.RawImu:
    """Decode RAW_IMU."""
    x, y, z = (value * _MILLI_G for value in f[1:4])
    p, q, r, north, east, down = (value / 1e3 for value in f[4:10])
    return m.RawImu(s, f[0], (x, y, z), (p, q, r), (north, east, down))


def raw_imu_fields(x: m.RawImu) -> Fields:
    """Encode RAW_IMU."""
    force = (int16(value / _MILLI_G) for value in x.specific_force)
    rest = (int16(value * 1e3) for value in (*x.body_rates, *x.magnetic_field))
    return x.time_boot, *force, *rest, 0, 0


def highres_imu(s: m.Source, f: Fields) -> m.HighresImu:
    """Decode HIGHRES_IMU."""
    return m.HighresImu(s, f[0], f[1:4], f[4:7], f[7:10], f[10], f[12], f[13])


def highres_imu_fields(x: m.HighresImu) -> Fields:
    """Encode HIGHRES_IMU."""
    motion = *x.specific_force, *x.body_rates, *x.magnetic_field
    return x.time_boot, *motion, x.pressure, 0.0, x.pressure_altitude, x.temperature, _ALL_UPDATED, 0


def sim_state(s: m.Source, f: Fields) -> m.SimState | None:
    """Decode SIMSTATE; return None if a field is invalid."""
    if not on_globe(f[9], f[10]):
        return None
    roll, pitch, yaw = f[:3]
    return m.SimState(s, roll, pitch, yaw, f[3:6], f[6:9], f[9] / 1e7, f[10] / 1e7)


def sim_state_fields(x: m.SimState) -> Fields:
    """Encode SIMSTATE; raise EncodeError for a value that does not fit."""
    place = degrees_e7("latitude", x.latitude, 90), degrees_e7("longitude", x.longitude, 180)
    return x.roll, x.pitch, x.yaw, *x.specific_force, *x.body_rates, *place


def simulation_state(s: m.Source, f: Fields) -> m.SimulationState | None:
    """Decode SIM_STATE; return None if a field is invalid."""
    latitude, longitude = f[21:]
    # Float degrees have a resolution of half a metre: they serve only where the extension fields are missing.
    if not (latitude or longitude):
        if not (isfinite(f[13]) and isfinite(f[14])):
            return None
        latitude, longitude = round(f[13] * 1e7), round(f[14] * 1e7)
    if not on_globe(latitude, longitude):
        return None
    return m.SimulationState(s, latitude / 1e7, longitude / 1e7, f[15], f[18:21])


def simulation_state_fields(x: m.SimulationState) -> Fields:
    """Encode SIM_STATE; raise EncodeError for a value that does not fit."""
    place = degrees_e7("latitude", x.latitude, 90), degrees_e7("longitude", x.longitude, 180)
    attitude = (1.0, *[0.0] * 12)
    return *attitude, x.latitude, x.longitude, x.altitude, 0.0, 0.0, *x.velocity_ned, *place


def hil_state(s: m.Source, f: Fields) -> m.HilState | None:
    """Decode HIL_STATE_QUATERNION; return None if a field is invalid."""
    latitude, longitude, altitude, vx, vy, vz = f[8:14]
    if not on_globe(latitude, longitude):
        return None
    velocity = (vx / 1e2, vy / 1e2, vz / 1e2)
    return m.HilState(s, f[0], latitude / 1e7, longitude / 1e7, altitude / 1e3, velocity)


def hil_state_fields(x: m.HilState) -> Fields:
    """Encode HIL_STATE_QUATERNION; raise EncodeError for a value that does not fit."""
    place = degrees_e7("latitude", x.latitude, 90), degrees_e7("longitude", x.longitude, 180)
    velocity = (round(v * 1e2) for v in x.velocity_ned)
    attitude = (1.0, *[0.0] * 6)
    return x.time, *attitude, *place, round(x.altitude * 1e3), *velocity, *[0] * 5
