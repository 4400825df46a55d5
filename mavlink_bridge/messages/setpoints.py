"""Messages of set-points, and the autopilot's echo of them."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import Fields
from mavlink_bridge.messages.source import Source, Vector


@message("SET_POSITION_TARGET_LOCAL_NED")
class SetpointLocal(NamedTuple):
    """SET_POSITION_TARGET_LOCAL_NED (84) as sent, including ignored fields, which may hold NaN."""

    source: Source
    time_boot: int
    target_system: int
    target_component: int
    frame: int
    type_mask: int
    position: Vector
    velocity: Vector
    acceleration: Vector
    yaw: float
    yaw_rate: float

    @staticmethod
    def decode(source: Source, fields: Fields) -> SetpointLocal:
        time, x, y, z, vx, vy, vz, ax, ay, az, yaw, yaw_rate, mask, system, component, frame = fields
        return SetpointLocal(
            source,
            time * 1000,
            system,
            component,
            frame,
            mask,
            (x, y, z),
            (vx, vy, vz),
            (ax, ay, az),
            yaw,
            yaw_rate,
        )

    def encode(self) -> Fields:
        return (
            self.time_boot // 1000,
            *self.position,
            *self.velocity,
            *self.acceleration,
            self.yaw,
            self.yaw_rate,
            self.type_mask,
            self.target_system,
            self.target_component,
            self.frame,
        )


@message("SET_POSITION_TARGET_GLOBAL_INT")
class SetpointGlobal(NamedTuple):
    """SET_POSITION_TARGET_GLOBAL_INT (86) as sent.

    ``x``, ``y`` are the raw int32 (degE7); ``altitude`` (m) is relative to the reference of ``frame``.
    """

    source: Source
    time_boot: int
    target_system: int
    target_component: int
    frame: int
    type_mask: int
    x: int
    y: int
    altitude: float
    velocity: Vector
    acceleration: Vector
    yaw: float
    yaw_rate: float

    @staticmethod
    def decode(source: Source, fields: Fields) -> SetpointGlobal:
        time, x, y, altitude, vx, vy, vz, ax, ay, az, yaw, yaw_rate, mask, system, component, frame = fields
        target = system, component, frame, mask
        return SetpointGlobal(
            source, time * 1000, *target, x, y, altitude, (vx, vy, vz), (ax, ay, az), yaw, yaw_rate
        )

    def encode(self) -> Fields:
        return (
            self.time_boot // 1000,
            self.x,
            self.y,
            self.altitude,
            *self.velocity,
            *self.acceleration,
            self.yaw,
            self.yaw_rate,
            self.type_mask,
            self.target_system,
            self.target_component,
            self.frame,
        )


@message("SET_ATTITUDE_TARGET")
class SetpointAttitude(NamedTuple):
    """SET_ATTITUDE_TARGET (82) as sent, including ignored fields.

    Attitude (w, x, y, z; FRD body to NED), body rates (rad/s) and thrust.
    """

    source: Source
    time_boot: int
    target_system: int
    target_component: int
    type_mask: int
    attitude: tuple[float, float, float, float]
    body_rates: Vector
    thrust: float

    @staticmethod
    def decode(source: Source, fields: Fields) -> SetpointAttitude:
        return SetpointAttitude(
            source, fields[0] * 1000, fields[9], fields[10], fields[11], fields[1:5], fields[5:8], fields[8]
        )

    def encode(self) -> Fields:
        return (
            self.time_boot // 1000,
            *self.attitude,
            *self.body_rates,
            self.thrust,
            self.target_system,
            self.target_component,
            self.type_mask,
        )


@message("POSITION_TARGET_LOCAL_NED")
class PositionTarget(NamedTuple):
    """POSITION_TARGET_LOCAL_NED (85): the autopilot's echo of the set-point that it follows."""

    source: Source
    time_boot: int
    frame: int
    type_mask: int
    position: Vector
    velocity: Vector
    acceleration: Vector
    yaw: float
    yaw_rate: float

    @staticmethod
    def decode(source: Source, fields: Fields) -> PositionTarget:
        time, x, y, z, vx, vy, vz, ax, ay, az, yaw, yaw_rate, mask, frame = fields
        return PositionTarget(
            source, time * 1000, frame, mask, (x, y, z), (vx, vy, vz), (ax, ay, az), yaw, yaw_rate
        )

    def encode(self) -> Fields:
        return (
            self.time_boot // 1000,
            *self.position,
            *self.velocity,
            *self.acceleration,
            self.yaw,
            self.yaw_rate,
            self.type_mask,
            self.frame,
        )
