"""Messages of sensors: GNSS receiver and inertial measurement unit."""

from __future__ import annotations

from math import degrees, radians, remainder, tau
from typing import NamedTuple

from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import (
    FULL_CIRCLE_CDEG,
    UNKNOWN_U16,
    Fields,
    degrees_e7,
    int16,
    on_globe,
    or_none,
    or_unknown,
)
from mavlink_bridge.messages.source import Source, Vector

_UNKNOWN_U8 = 0xFF
_MILLI_G = 9.80665e-3
# HIGHRES_IMU.fields_updated with the bits of all 13 measured values.
_ALL_UPDATED = 0x1FFF


@message("GPS_RAW_INT", size_v1=30)
class GpsRaw(NamedTuple):
    """GPS_RAW_INT (24).

    ``time`` µs since boot; ``hdop``, ``vdop``: dilutions of precision; ``speed`` (m/s) and ``course`` (rad
    clockwise from north) over ground; the three accuracies in m, m and m/s, 0 if unknown.
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

    @staticmethod
    def decode(source: Source, fields: Fields) -> GpsRaw | None:
        time, latitude, longitude, altitude, hdop, vdop, speed, course, fix, satellites = fields[:10]
        if not on_globe(latitude, longitude):
            return None
        return GpsRaw(
            source,
            time,
            fix,
            latitude / 1e7,
            longitude / 1e7,
            altitude / 1e3,
            or_none(hdop, 1e2),
            or_none(vdop, 1e2),
            or_none(speed, 1e2),
            remainder(radians(course / 100), tau) if course <= FULL_CIRCLE_CDEG else None,
            None if satellites == _UNKNOWN_U8 else satellites,
            fields[10] / 1e3,
            fields[11] / 1e3,
            fields[12] / 1e3,
            fields[13] / 1e3,
        )

    def encode(self) -> Fields:
        return (
            self.time,
            *degrees_e7(self.latitude, self.longitude),
            round(self.altitude * 1e3),
            or_unknown("hdop", self.hdop, 1e2),
            or_unknown("vdop", self.vdop, 1e2),
            or_unknown("speed", self.speed, 1e2),
            UNKNOWN_U16 if self.course is None else round(degrees(self.course) * 100) % FULL_CIRCLE_CDEG,
            self.fix_type,
            _UNKNOWN_U8 if self.satellites is None else self.satellites,
            round(self.altitude_ellipsoid * 1e3),
            round(self.horizontal_accuracy * 1e3),
            round(self.vertical_accuracy * 1e3),
            round(self.speed_accuracy * 1e3),
            0,
            0,
        )


@message("RAW_IMU", size_v1=26)
class RawImu(NamedTuple):
    """RAW_IMU (27): specific force (m/s²), body rates (rad/s), magnetic field (gauss); all in body FRD.

    ``time_boot`` µs. The encoder saturates at int16, as a sensor does.
    """

    source: Source
    time_boot: int
    specific_force: Vector
    body_rates: Vector
    magnetic_field: Vector

    @staticmethod
    def decode(source: Source, fields: Fields) -> RawImu:
        return RawImu(source, fields[0], *_measured(fields[1:10]))

    def encode(self) -> Fields:
        return self.time_boot, *_scaled(*self[2:]), 0, 0


@message("SCALED_IMU", size_v1=22)
class ScaledImu(NamedTuple):
    """SCALED_IMU (26): as RAW_IMU."""

    source: Source
    time_boot: int
    specific_force: Vector
    body_rates: Vector
    magnetic_field: Vector

    @staticmethod
    def decode(source: Source, fields: Fields) -> ScaledImu:
        return ScaledImu(source, fields[0] * 1000, *_measured(fields[1:10]))

    def encode(self) -> Fields:
        return self.time_boot // 1000, *_scaled(*self[2:]), 0


def _measured(fields: Fields) -> tuple[Vector, Vector, Vector]:
    """Return specific force, body rates and magnetic field of nine integers, mg, mrad/s and mgauss."""
    x, y, z = (value * _MILLI_G for value in fields[:3])
    p, q, r, mx, my, mz = (value / 1e3 for value in fields[3:])
    return (x, y, z), (p, q, r), (mx, my, mz)


def _scaled(force: Vector, rates: Vector, field: Vector) -> Fields:
    """Return the nine integers of ``_measured``."""
    return (
        *(int16(value / _MILLI_G) for value in force),
        *(int16(value * 1e3) for value in (*rates, *field)),
    )


@message("HIGHRES_IMU", finite=True, size_v1=62)
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

    @staticmethod
    def decode(source: Source, fields: Fields) -> HighresImu:
        return HighresImu(
            source, fields[0], fields[1:4], fields[4:7], fields[7:10], fields[10], fields[12], fields[13]
        )

    def encode(self) -> Fields:
        motion = *self.specific_force, *self.body_rates, *self.magnetic_field
        return (
            self.time_boot,
            *motion,
            self.pressure,
            0.0,
            self.pressure_altitude,
            self.temperature,
            _ALL_UPDATED,
            0,
        )
