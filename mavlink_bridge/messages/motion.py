"""Messages of motion: attitude, position and velocity of a vehicle or of a target."""

from __future__ import annotations

from math import degrees, isfinite, radians, remainder, tau
from typing import NamedTuple

from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import FULL_CIRCLE_CDEG, UNKNOWN_U16, Fields, degrees_e7, on_globe
from mavlink_bridge.messages.source import Source, Vector

# Bits of FOLLOW_TARGET.est_capabilities.
HAS_POSITION = 0x1
HAS_VELOCITY = 0x2
# ATTITUDE_QUATERNION.repr_offset_q; zeros mean that there is no offset.
_NO_OFFSET = (0.0, 0.0, 0.0, 0.0)


@message("ATTITUDE", finite=True)
class Attitude(NamedTuple):
    """ATTITUDE (30): FRD body relative to local NED; Euler angles (rad) and body rates (rad/s)."""

    source: Source
    time_boot: int
    roll: float
    pitch: float
    yaw: float
    body_rates: Vector

    @staticmethod
    def decode(source: Source, fields: Fields) -> Attitude:
        time, roll, pitch, yaw, p, q, r = fields
        return Attitude(source, time * 1000, roll, pitch, yaw, (p, q, r))

    def encode(self) -> Fields:
        return self.time_boot // 1000, self.roll, self.pitch, self.yaw, *self.body_rates


@message("ATTITUDE_QUATERNION", finite=True, size_v1=32)
class AttitudeQuaternion(NamedTuple):
    """ATTITUDE_QUATERNION (31): FRD body to local NED as (w, x, y, z); body rates (rad/s)."""

    source: Source
    time_boot: int
    attitude: tuple[float, float, float, float]
    body_rates: Vector

    @staticmethod
    def decode(source: Source, fields: Fields) -> AttitudeQuaternion:
        return AttitudeQuaternion(source, fields[0] * 1000, fields[1:5], fields[5:8])

    def encode(self) -> Fields:
        return self.time_boot // 1000, *self.attitude, *self.body_rates, *_NO_OFFSET


@message("LOCAL_POSITION_NED", finite=True)
class LocalPosition(NamedTuple):
    """LOCAL_POSITION_NED (32), relative to the sender's *own* origin: not comparable between vehicles."""

    source: Source
    time_boot: int
    position_ned: Vector
    velocity_ned: Vector

    @staticmethod
    def decode(source: Source, fields: Fields) -> LocalPosition:
        time, x, y, z, vx, vy, vz = fields
        return LocalPosition(source, time * 1000, (x, y, z), (vx, vy, vz))

    def encode(self) -> Fields:
        return self.time_boot // 1000, *self.position_ned, *self.velocity_ned


@message("GLOBAL_POSITION_INT", finite=True)
class GlobalPosition(NamedTuple):
    """GLOBAL_POSITION_INT (33).

    ``altitude`` above mean sea level, ``relative_altitude`` above home, ``yaw`` clockwise from north in rad
    or None.
    """

    source: Source
    time_boot: int
    latitude: float
    longitude: float
    altitude: float
    relative_altitude: float
    velocity_ned: Vector
    yaw: float | None

    @staticmethod
    def decode(source: Source, fields: Fields) -> GlobalPosition | None:
        time, latitude, longitude, altitude, relative, vx, vy, vz, heading = fields
        if not on_globe(latitude, longitude):
            return None
        return GlobalPosition(
            source,
            time * 1000,
            latitude / 1e7,
            longitude / 1e7,
            altitude / 1e3,
            relative / 1e3,
            (vx / 1e2, vy / 1e2, vz / 1e2),
            remainder(radians(heading / 100), tau) if heading <= FULL_CIRCLE_CDEG else None,
        )

    def encode(self) -> Fields:
        vx, vy, vz = self.velocity_ned
        return (
            self.time_boot // 1000,
            *degrees_e7(self.latitude, self.longitude),
            round(self.altitude * 1e3),
            round(self.relative_altitude * 1e3),
            round(vx * 1e2),
            round(vy * 1e2),
            round(vz * 1e2),
            UNKNOWN_U16 if self.yaw is None else round(degrees(self.yaw) * 100) % FULL_CIRCLE_CDEG,
        )


@message("ALTITUDE")
class Altitude(NamedTuple):
    """ALTITUDE (141): altitudes in m, NaN if not measured; ``time`` µs since boot."""

    source: Source
    time: int
    monotonic: float
    above_sea: float
    local: float
    relative: float
    terrain: float
    clearance: float


@message("VFR_HUD", finite=True)
class VfrHud(NamedTuple):
    """VFR_HUD (74): speeds m/s, altitude m above mean sea level, ``heading`` rad 0…2π, ``throttle`` 0…1."""

    source: Source
    airspeed: float
    ground_speed: float
    altitude: float
    climb: float
    heading: float
    throttle: float

    @staticmethod
    def decode(source: Source, fields: Fields) -> VfrHud:
        airspeed, ground_speed, altitude, climb, heading, throttle = fields
        return VfrHud(source, airspeed, ground_speed, altitude, climb, radians(heading % 360), throttle / 100)

    def encode(self) -> Fields:
        heading = round(degrees(self.heading)) % 360
        return (
            self.airspeed,
            self.ground_speed,
            self.altitude,
            self.climb,
            heading,
            round(self.throttle * 100),
        )


@message("FOLLOW_TARGET")
class FollowTarget(NamedTuple):
    """FOLLOW_TARGET (144): position of a target to follow, in degrees, m above mean sea level, m/s NED.

    ``velocity`` is None where the sender does not know it.
    """

    source: Source
    time_boot: int
    latitude: float
    longitude: float
    altitude: float
    velocity: Vector | None

    @staticmethod
    def decode(source: Source, fields: Fields) -> FollowTarget | None:
        time, _, latitude, longitude, altitude, vx, vy, vz = fields[:8]
        # Covariances and similar fields are not used, and may hold any value.
        if not (on_globe(latitude, longitude) and fields[-1] & HAS_POSITION and isfinite(altitude)):
            return None
        # A sender that does not know its velocity, such as MAVSDK, says NaN.
        velocity = (vx, vy, vz) if fields[-1] & HAS_VELOCITY and isfinite(vx + vy + vz) else None
        return FollowTarget(source, time * 1000, latitude / 1e7, longitude / 1e7, altitude, velocity)

    def encode(self) -> Fields:
        return (
            self.time_boot // 1000,
            0,
            *degrees_e7(self.latitude, self.longitude),
            self.altitude,
            *(self.velocity or (0.0, 0.0, 0.0)),
            *(0.0,) * 13,
            HAS_POSITION | (0 if self.velocity is None else HAS_VELOCITY),
        )
