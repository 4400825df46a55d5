"""Fields of the messages in ``messages.flight``.

The module is longer than others because it is a list: two short functions for each message.
"""

from __future__ import annotations

from math import degrees, isfinite, radians, remainder, tau

from mavlink_bridge import messages as m
from mavlink_bridge.errors import EncodeError
from mavlink_bridge.wire.fields.units import FULL_CIRCLE_CDEG, UNKNOWN_U16, Fields, degrees_e7, on_globe

TEXT_LENGTH = 50
TUNNEL_LENGTH = 128
# Bits of FOLLOW_TARGET.est_capabilities.
HAS_POSITION = 0x1
HAS_VELOCITY = 0x2


def heartbeat(s: m.Source, f: Fields) -> m.Heartbeat:
    """Decode HEARTBEAT."""
    custom_mode, kind, autopilot, base_mode, status, _ = f
    return m.Heartbeat(s, kind, autopilot, base_mode, custom_mode, status)


def heartbeat_fields(x: m.Heartbeat) -> Fields:
    """Encode HEARTBEAT."""
    return x.custom_mode, x.type, x.autopilot, x.base_mode, x.system_status, 3


def sys_status(s: m.Source, f: Fields) -> m.SysStatus:
    """Decode SYS_STATUS."""
    voltage, remaining = f[4], f[12]
    return m.SysStatus(
        s,
        f[0],
        f[1],
        f[2],
        None if voltage == UNKNOWN_U16 else voltage / 1e3,
        remaining / 100 if 0 <= remaining <= 100 else None,
    )


def sys_status_fields(x: m.SysStatus) -> Fields:
    """Encode SYS_STATUS; raise EncodeError for a value that does not fit."""
    voltage, remaining = UNKNOWN_U16, -1
    if x.battery_voltage is not None:
        voltage = round(x.battery_voltage * 1e3)
        if voltage == UNKNOWN_U16:
            raise EncodeError(f"SYS_STATUS: battery_voltage = {x.battery_voltage} V would read as unknown")
    if x.battery_remaining is not None:
        remaining = round(x.battery_remaining * 100)
        if not 0 <= remaining <= 100:
            raise EncodeError(f"SYS_STATUS: battery_remaining = {x.battery_remaining} is outside 0…1")
    return x.present, x.enabled, x.health, 0, voltage, -1, 0, 0, 0, 0, 0, 0, remaining, 0, 0, 0


def system_time(s: m.Source, f: Fields) -> m.SystemTime:
    """Decode SYSTEM_TIME."""
    return m.SystemTime(s, f[0], f[1] * 1000)


def system_time_fields(x: m.SystemTime) -> Fields:
    """Encode SYSTEM_TIME."""
    return x.unix_time, x.time_boot // 1000


def ping(s: m.Source, f: Fields) -> m.Ping:
    """Decode PING."""
    return m.Ping(s, *f)


def attitude(s: m.Source, f: Fields) -> m.Attitude:
    """Decode ATTITUDE."""
    time, roll, pitch, yaw, p, q, r = f
    return m.Attitude(s, time * 1000, roll, pitch, yaw, (p, q, r))


def attitude_fields(x: m.Attitude) -> Fields:
    """Encode ATTITUDE."""
    return x.time_boot // 1000, x.roll, x.pitch, x.yaw, *x.body_rates


def local_position(s: m.Source, f: Fields) -> m.LocalPosition:
    """Decode LOCAL_POSITION_NED."""
    time, x, y, z, vx, vy, vz = f
    return m.LocalPosition(s, time * 1000, (x, y, z), (vx, vy, vz))


def local_position_fields(x: m.LocalPosition) -> Fields:
    """Encode LOCAL_POSITION_NED."""
    return x.time_boot // 1000, *x.position_ned, *x.velocity_ned


def global_position(s: m.Source, f: Fields) -> m.GlobalPosition | None:
    """Decode GLOBAL_POSITION_INT; return None if a field is invalid."""
    time, latitude, longitude, altitude, relative, vx, vy, vz, heading = f
    if not on_globe(latitude, longitude):
        return None
    return m.GlobalPosition(
        s,
        time * 1000,
        latitude / 1e7,
        longitude / 1e7,
        altitude / 1e3,
        relative / 1e3,
        (vx / 1e2, vy / 1e2, vz / 1e2),
        remainder(radians(heading / 100), tau) if heading <= FULL_CIRCLE_CDEG else None,
    )


def global_position_fields(x: m.GlobalPosition) -> Fields:
    """Encode GLOBAL_POSITION_INT; raise EncodeError for a value that does not fit."""
    vx, vy, vz = x.velocity_ned
    return (
        x.time_boot // 1000,
        degrees_e7("latitude", x.latitude, 90),
        degrees_e7("longitude", x.longitude, 180),
        round(x.altitude * 1e3),
        round(x.relative_altitude * 1e3),
        round(vx * 1e2),
        round(vy * 1e2),
        round(vz * 1e2),
        UNKNOWN_U16 if x.yaw is None else round(degrees(x.yaw) * 100) % FULL_CIRCLE_CDEG,
    )


def origin(s: m.Source, f: Fields) -> m.GpsGlobalOrigin | None:
    """Decode GPS_GLOBAL_ORIGIN; return None if a field is invalid."""
    latitude, longitude, altitude, time = f
    if not on_globe(latitude, longitude):
        return None
    return m.GpsGlobalOrigin(s, latitude / 1e7, longitude / 1e7, altitude / 1e3, time)


def origin_fields(x: m.GpsGlobalOrigin) -> Fields:
    """Encode GPS_GLOBAL_ORIGIN; raise EncodeError for a value that does not fit."""
    return (
        degrees_e7("latitude", x.latitude, 90),
        degrees_e7("longitude", x.longitude, 180),
        round(x.altitude * 1e3),
        x.time,
    )


def command_int(s: m.Source, f: Fields) -> m.CommandInt:
    """Decode COMMAND_INT."""
    p1, p2, p3, p4, x, y, z, command, system, component, frame, _, _ = f
    return m.CommandInt(s, system, component, frame, command, (p1, p2, p3, p4), x, y, z)


def command_int_fields(x: m.CommandInt) -> Fields:
    """Encode COMMAND_INT."""
    return (
        *x.params,
        x.x,
        x.y,
        x.z,
        x.command,
        x.target_system,
        x.target_component,
        x.frame,
        0,
        0,
    )


def command_long(s: m.Source, f: Fields) -> m.CommandLong:
    """Decode COMMAND_LONG."""
    return m.CommandLong(s, f[8], f[9], f[7], f[10], f[:7])


def command_long_fields(x: m.CommandLong) -> Fields:
    """Encode COMMAND_LONG."""
    return *x.params, x.command, x.target_system, x.target_component, x.confirmation


def command_ack(s: m.Source, f: Fields) -> m.CommandAck:
    """Decode COMMAND_ACK."""
    return m.CommandAck(s, *f)


def setpoint(s: m.Source, f: Fields) -> m.SetpointLocal:
    """Decode SET_POSITION_TARGET_LOCAL_NED."""
    time, x, y, z, vx, vy, vz, ax, ay, az, yaw, yaw_rate, mask, system, component, frame = f
    return m.SetpointLocal(
        s,
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


def setpoint_fields(x: m.SetpointLocal) -> Fields:
    """Encode SET_POSITION_TARGET_LOCAL_NED."""
    return (
        x.time_boot // 1000,
        *x.position,
        *x.velocity,
        *x.acceleration,
        x.yaw,
        x.yaw_rate,
        x.type_mask,
        x.target_system,
        x.target_component,
        x.frame,
    )


def setpoint_global(s: m.Source, f: Fields) -> m.SetpointGlobal:
    """Decode SET_POSITION_TARGET_GLOBAL_INT."""
    time, x, y, altitude, vx, vy, vz, ax, ay, az, yaw, yaw_rate, mask, system, component, frame = f
    target = system, component, frame, mask
    return m.SetpointGlobal(
        s, time * 1000, *target, x, y, altitude, (vx, vy, vz), (ax, ay, az), yaw, yaw_rate
    )


def setpoint_global_fields(x: m.SetpointGlobal) -> Fields:
    """Encode SET_POSITION_TARGET_GLOBAL_INT."""
    return (
        x.time_boot // 1000,
        x.x,
        x.y,
        x.altitude,
        *x.velocity,
        *x.acceleration,
        x.yaw,
        x.yaw_rate,
        x.type_mask,
        x.target_system,
        x.target_component,
        x.frame,
    )


def setpoint_attitude(s: m.Source, f: Fields) -> m.SetpointAttitude:
    """Decode SET_ATTITUDE_TARGET."""
    return m.SetpointAttitude(s, f[0] * 1000, f[9], f[10], f[11], f[1:5], f[5:8], f[8])


def setpoint_attitude_fields(x: m.SetpointAttitude) -> Fields:
    """Encode SET_ATTITUDE_TARGET."""
    return (
        x.time_boot // 1000,
        *x.attitude,
        *x.body_rates,
        x.thrust,
        x.target_system,
        x.target_component,
        x.type_mask,
    )


def follow_target(s: m.Source, f: Fields) -> m.FollowTarget | None:
    """Decode FOLLOW_TARGET; return None unless it has a valid position and finite velocities."""
    time, _, latitude, longitude, altitude, vx, vy, vz = f[:8]
    # Covariances and similar fields are not used, and may hold any value.
    if not (on_globe(latitude, longitude) and f[-1] & HAS_POSITION and isfinite(altitude + vx + vy + vz)):
        return None
    velocity = (vx, vy, vz) if f[-1] & HAS_VELOCITY else None
    return m.FollowTarget(s, time * 1000, latitude / 1e7, longitude / 1e7, altitude, velocity)


def follow_target_fields(x: m.FollowTarget) -> Fields:
    """Encode FOLLOW_TARGET; raise EncodeError for a value that does not fit."""
    return (
        x.time_boot // 1000,
        0,
        degrees_e7("latitude", x.latitude, 90),
        degrees_e7("longitude", x.longitude, 180),
        x.altitude,
        *(x.velocity or (0.0, 0.0, 0.0)),
        *(0.0,) * 13,
        HAS_POSITION | (0 if x.velocity is None else HAS_VELOCITY),
    )


def fence_status(s: m.Source, f: Fields) -> m.FenceStatus:
    """Decode FENCE_STATUS."""
    time, count, breached, kind, _ = f
    return m.FenceStatus(s, time * 1000, bool(breached), count, kind)


def fence_status_fields(x: m.FenceStatus) -> Fields:
    """Encode FENCE_STATUS."""
    return x.time_boot // 1000, x.breaches, int(x.breached), x.kind, 0


def position_target(s: m.Source, f: Fields) -> m.PositionTarget:
    """Decode POSITION_TARGET_LOCAL_NED."""
    time, x, y, z, vx, vy, vz, ax, ay, az, yaw, yaw_rate, mask, frame = f
    return m.PositionTarget(s, time * 1000, frame, mask, (x, y, z), (vx, vy, vz), (ax, ay, az), yaw, yaw_rate)


def position_target_fields(x: m.PositionTarget) -> Fields:
    """Encode POSITION_TARGET_LOCAL_NED."""
    return (
        x.time_boot // 1000,
        *x.position,
        *x.velocity,
        *x.acceleration,
        x.yaw,
        x.yaw_rate,
        x.type_mask,
        x.frame,
    )


def timesync(s: m.Source, f: Fields) -> m.Timesync:
    """Decode TIMESYNC."""
    return m.Timesync(s, *f)


def ekf_status(s: m.Source, f: Fields) -> m.EkfStatus:
    """Decode EKF_STATUS_REPORT."""
    return m.EkfStatus(s, f[5], *f[:4])


def ekf_status_fields(x: m.EkfStatus) -> Fields:
    """Encode EKF_STATUS_REPORT."""
    return x.velocity, x.horizontal, x.vertical, x.magnetic, 0.0, x.flags, 0.0


def extended_sys_state(s: m.Source, f: Fields) -> m.ExtendedSysState:
    """Decode EXTENDED_SYS_STATE."""
    return m.ExtendedSysState(s, *f)


def status_text(s: m.Source, f: Fields) -> m.StatusText:
    """Decode STATUSTEXT."""
    return m.StatusText(s, f[0], f[1].split(b"\0", 1)[0].decode("utf-8", errors="replace"))


def status_text_fields(x: m.StatusText) -> Fields:
    """Encode STATUSTEXT."""
    return x.severity, text_bytes(x.text)[:TEXT_LENGTH], 0, 0


def text_bytes(text: str) -> bytes:
    """Return ``text`` in ASCII, with a question mark for any other character and a space for NUL.

    A NUL would end the text.
    """
    return text.replace("\0", " ").encode("ascii", errors="replace")


def text_chunks(text: str) -> list[bytes]:
    """Split ``text`` into at most 255 pieces of at most 50 bytes.

    The last one is shorter, because its NUL tells the receiver that the text is complete. The number of a
    piece is one byte.
    """
    data = text_bytes(text)[: TEXT_LENGTH * 255 - 1]
    return [data[at : at + TEXT_LENGTH] for at in range(0, len(data) + 1, TEXT_LENGTH)]


def tunnel(s: m.Source, f: Fields) -> m.Tunnel | None:
    """Decode TUNNEL; return None if a field is invalid."""
    payload_type, system, component, length, payload = f
    if length > TUNNEL_LENGTH:
        return None
    return m.Tunnel(s, system, component, payload_type, payload[:length])


def tunnel_fields(x: m.Tunnel) -> Fields:
    """Encode TUNNEL; raise EncodeError for a value that does not fit."""
    if len(x.payload) > TUNNEL_LENGTH:
        raise EncodeError(f"TUNNEL: payload of {len(x.payload)} bytes is longer than {TUNNEL_LENGTH}")
    return x.payload_type, x.target_system, x.target_component, len(x.payload), bytes(x.payload)
