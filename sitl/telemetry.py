"""What the autopilot tells, and when: integer due times, one list of messages per step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from mavlink_bridge.messages import (
    Attitude,
    EkfStatus,
    ExtendedSysState,
    GlobalPosition,
    GpsGlobalOrigin,
    Heartbeat,
    LocalPosition,
    Message,
    PositionTarget,
    Source,
    SysStatus,
)
from sitl.autopilot_config import TelemetryRates
from sitl.origin import Origin
from sitl.sensors import Estimate
from sitl.setpoints import LOCAL_NED, Setpoint, mask_of

HEARTBEAT: Final = 0
SYS_STATUS: Final = 1
ATTITUDE: Final = 30
LOCAL_POSITION: Final = 32
GLOBAL_POSITION: Final = 33
ORIGIN: Final = 49
POSITION_TARGET: Final = 85
EKF_STATUS: Final = 193
EXTENDED_SYS_STATE: Final = 245

ON_GROUND: Final = 1
IN_AIR: Final = 2
TAKING_OFF: Final = 3
LANDING: Final = 4

# MAV_TYPE by the number of rotors, else generic
_TYPES: Final = {4: 2, 6: 13, 8: 14}
_STANDBY: Final = 3
_ACTIVE: Final = 4
_CALIBRATING: Final = 2
_CRITICAL: Final = 5

# MAV_SYS_STATUS_SENSOR: gyro, accelerometer, magnetometer, barometer; control of rate, attitude, yaw, height
# and position; motors, AHRS. GPS and the prearm check wait for a position.
_SENSORS: Final = 0x1 | 0x2 | 0x4 | 0x8 | 0x400 | 0x800 | 0x1000 | 0x2000 | 0x4000 | 0x8000 | 0x200000
_GPS: Final = 0x20
_PREARM: Final = 0x10000000

# ESTIMATOR_STATUS_FLAGS: attitude, velocities, relative and absolute position, and their predictions.
_EKF_READY: Final = 0x1 | 0x2 | 0x4 | 0x8 | 0x10 | 0x20 | 0x100 | 0x200
_EKF_WAITING: Final = 0x1 | 0x80 | 0x400
# Without GPS for too long: attitude, vertical velocity and height by barometer, constant position assumed.
_EKF_LOST: Final = 0x1 | 0x4 | 0x20 | 0x80

_NEVER: Final = 1 << 62


class Snapshot(NamedTuple):
    """All that a message may tell. ``time`` since boot (µs); ``base_mode`` with the armed bit; ``target``
    gives the set-point that is followed now, None when there is none. ``located``: the estimator has a
    position or waits for its first; ``fixed``: there is GPS; ``silent``: position messages fail to come."""

    source: Source
    time: int
    estimate: Estimate
    origin: Origin
    ready: bool
    armed: bool
    rotors: int
    autopilot: int
    base_mode: int
    custom_mode: int
    landed_state: int
    target: Callable[[], Setpoint | None]
    echoes_yaw: bool
    located: bool
    fixed: bool
    silent: bool


def _heartbeat(s: Snapshot) -> Message:
    idle = _STANDBY if s.ready else _CALIBRATING
    flying = _ACTIVE if s.located else _CRITICAL
    state = flying if s.armed else idle
    return Heartbeat(s.source, _TYPES.get(s.rotors, 0), s.autopilot, s.base_mode, s.custom_mode, state)


def _sys_status(s: Snapshot) -> Message:
    known = _SENSORS | _GPS | _PREARM
    health = (known if s.ready else _SENSORS) & ~(0 if s.fixed else _GPS)
    return SysStatus(s.source, known, known, health, None, None)


def _attitude(s: Snapshot) -> Message:
    e = s.estimate
    return Attitude(s.source, s.time, e.roll, e.pitch, e.yaw, e.body_rates)


def _local_position(s: Snapshot) -> Message | None:
    if not s.ready or s.silent:
        return None
    return LocalPosition(s.source, s.time, s.estimate.position, s.estimate.velocity)


def _global_position(s: Snapshot) -> Message | None:
    if not s.ready or s.silent:
        return None
    e, origin = s.estimate, s.origin
    latitude, longitude, altitude = origin.geodetic(e.position)
    return GlobalPosition(
        s.source, s.time, latitude, longitude, altitude, altitude - origin.altitude, e.velocity, e.yaw
    )


def _origin(s: Snapshot) -> Message | None:
    o = s.origin
    known = s.ready or not s.located
    return GpsGlobalOrigin(s.source, o.latitude, o.longitude, o.altitude, s.time) if known else None


def _position_target(s: Snapshot) -> Message | None:
    target = s.target()
    if target is None:
        return None
    if not s.echoes_yaw:
        target = target._replace(yaw=None, yaw_rate=None)
    return PositionTarget(
        s.source,
        s.time,
        LOCAL_NED,
        mask_of(target),
        target.position,
        target.velocity,
        target.acceleration,
        target.yaw or 0.0,
        target.yaw_rate or 0.0,
    )


def _ekf_status(s: Snapshot) -> Message:
    return EkfStatus(s.source, _EKF_READY if s.ready else _EKF_WAITING if s.located else _EKF_LOST)


def _extended_sys_state(s: Snapshot) -> Message:
    return ExtendedSysState(s.source, 0, s.landed_state)


Build = Callable[[Snapshot], Message | None]
"""One message; None when it has nothing to say yet."""


class _Stream:
    """One message and when it is due (µs); ``usual`` is the configured interval, 0 for none."""

    __slots__ = ("build", "due", "interval", "usual")

    def __init__(self, build: Build, rate: float) -> None:
        self.build = build
        self.usual = round(1e6 / rate) if rate else 0
        self.interval = self.usual
        self.due = _NEVER


class Telemetry:
    """The streams of one autopilot. ``next_due`` (µs): before it there is nothing to send."""

    def __init__(self, rates: TelemetryRates, reports_ekf: bool) -> None:
        self._streams = {
            HEARTBEAT: _Stream(_heartbeat, rates.heartbeat),
            SYS_STATUS: _Stream(_sys_status, rates.sys_status),
            ATTITUDE: _Stream(_attitude, rates.attitude),
            LOCAL_POSITION: _Stream(_local_position, rates.local_position),
            GLOBAL_POSITION: _Stream(_global_position, rates.global_position),
            ORIGIN: _Stream(_origin, rates.gps_global_origin),
            POSITION_TARGET: _Stream(_position_target, rates.position_target),
            EXTENDED_SYS_STATE: _Stream(_extended_sys_state, rates.extended_sys_state),
        }
        if reports_ekf:
            self._streams[EKF_STATUS] = _Stream(_ekf_status, rates.ekf_status)
        self._requested: list[int] = []
        self.next_due = _NEVER

    def start(self, now: int) -> None:
        """Every stream is due at ``now``, and from then on at whole intervals."""
        for stream in self._streams.values():
            stream.due = now if stream.interval else _NEVER
        self._schedule()

    def set_interval(self, message_id: int, interval: int, now: int) -> bool:
        """As SET_MESSAGE_INTERVAL (511): µs, 0 for the usual one, −1 for none. False when there is no such
        message."""
        stream = self._streams.get(message_id)
        if stream is None:
            return False
        wanted = max(0, stream.usual if interval == 0 else interval)
        if wanted != stream.interval:
            stream.interval = wanted
            stream.due = now + wanted if wanted else _NEVER
            self._schedule()
        return True

    def request(self, message_id: int) -> bool:
        """Send one at the next opportunity, whatever its stream does. False when there is no such message."""
        if message_id not in self._streams:
            return False
        self._requested.append(message_id)
        self.next_due = 0
        return True

    def collect(self, now: int, snapshot: Snapshot) -> list[Message]:
        """All that is due at ``now``. A stream that fell behind skips what it missed."""
        builds = [self._streams[message_id].build for message_id in self._requested]
        self._requested.clear()
        for stream in self._streams.values():
            if stream.due <= now:
                builds.append(stream.build)
                stream.due += stream.interval
                if stream.due <= now:
                    stream.due += (now - stream.due) // stream.interval * stream.interval + stream.interval
        self._schedule()
        return [message for build in builds if (message := build(snapshot)) is not None]

    def _schedule(self) -> None:
        self.next_due = 0 if self._requested else min(stream.due for stream in self._streams.values())
