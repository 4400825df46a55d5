"""Messages of flight: vehicle states, commands, set-points, texts and plans."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.messages.source import Source, Vector


class Heartbeat(NamedTuple):
    """HEARTBEAT (0)."""

    source: Source
    type: int
    autopilot: int
    base_mode: int
    custom_mode: int
    system_status: int


class SysStatus(NamedTuple):
    """SYS_STATUS (1): sensor bit masks and battery; ``battery_remaining`` in 0…1 or None."""

    source: Source
    present: int
    enabled: int
    health: int
    battery_voltage: float | None
    battery_remaining: float | None


class SystemTime(NamedTuple):
    """SYSTEM_TIME (2): Unix time and time since boot, µs."""

    source: Source
    unix_time: int
    time_boot: int


class Ping(NamedTuple):
    """PING (4)."""

    source: Source
    time: int
    sequence: int
    target_system: int
    target_component: int


class Attitude(NamedTuple):
    """ATTITUDE (30): FRD body relative to local NED; Euler angles (rad) and body rates (rad/s)."""

    source: Source
    time_boot: int
    roll: float
    pitch: float
    yaw: float
    body_rates: Vector


class LocalPosition(NamedTuple):
    """LOCAL_POSITION_NED (32), relative to the sender's *own* origin; never compare those of two vehicles."""

    source: Source
    time_boot: int
    position_ned: Vector
    velocity_ned: Vector


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


class GpsGlobalOrigin(NamedTuple):
    """GPS_GLOBAL_ORIGIN (49): the origin of the sender's local frame."""

    source: Source
    latitude: float
    longitude: float
    altitude: float
    time: int


class CommandInt(NamedTuple):
    """COMMAND_INT (75); ``x``, ``y`` are the raw int32 (degE7 in global frames)."""

    source: Source
    target_system: int
    target_component: int
    frame: int
    command: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float


class CommandLong(NamedTuple):
    """COMMAND_LONG (76): seven parameters as sent."""

    source: Source
    target_system: int
    target_component: int
    command: int
    confirmation: int
    params: tuple[float, float, float, float, float, float, float]


class CommandAck(NamedTuple):
    """COMMAND_ACK (77)."""

    source: Source
    command: int
    result: int
    progress: int
    result_param2: int
    target_system: int
    target_component: int


class SetpointLocal(NamedTuple):
    """SET_POSITION_TARGET_LOCAL_NED (84) as sent, including ignored fields (they may hold NaN)."""

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


class Timesync(NamedTuple):
    """TIMESYNC (111): ``tc1`` and ``ts1`` in ns, as in the message; tc1 = 0 is a request."""

    source: Source
    tc1: int
    ts1: int


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


class FenceStatus(NamedTuple):
    """FENCE_STATUS (162): time of the breach (µs since boot), kind (FENCE_BREACH), and number of breaches."""

    source: Source
    time_boot: int
    breached: bool
    breaches: int
    kind: int


class EkfStatus(NamedTuple):
    """EKF_STATUS_REPORT (193, ardupilotmega).

    Bit mask of ESTIMATOR flags; ratios of innovations to their gates (below 1 is good).
    """

    source: Source
    flags: int
    velocity: float = 0.0
    horizontal: float = 0.0
    vertical: float = 0.0
    magnetic: float = 0.0


class ExtendedSysState(NamedTuple):
    """EXTENDED_SYS_STATE (245): ``landed_state`` is MAV_LANDED_STATE."""

    source: Source
    vtol_state: int
    landed_state: int


class StatusText(NamedTuple):
    """STATUSTEXT (253): ``text`` at most 50 characters here; the encoder splits longer texts."""

    source: Source
    severity: int
    text: str


class Tunnel(NamedTuple):
    """TUNNEL (385): up to 128 bytes of ``payload_type``."""

    source: Source
    target_system: int
    target_component: int
    payload_type: int
    payload: bytes
