"""Schedule of telemetry: integer due times, one list of messages per step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Message
from sitl.config.autopilot import TelemetryRates
from sitl.telemetry import inertial_reports as n
from sitl.telemetry import output_reports as o
from sitl.telemetry import reports as r
from sitl.telemetry import status_reports as q
from sitl.telemetry.reports import Build, Snapshot

_NEVER: Final = 1 << 62


class _Stream:
    """One message and its due time; ``interval`` and the configured one, ``usual``, in µs, 0 for none."""

    __slots__ = ("build", "due", "interval", "usual")

    def __init__(self, build: Build, rate: float) -> None:
        self.build = build
        self.usual = round(1e6 / rate) if rate else 0
        self.interval = self.usual
        self.due = _NEVER


class Telemetry:
    """Telemetry streams of one autopilot. ``next_due`` (µs): earliest due time."""

    def __init__(self, rates: TelemetryRates, reports_ekf: bool) -> None:
        """``reports_ekf`` selects the streams of ArduPilot, else those of PX4.

        ArduPilot's are EKF_STATUS_REPORT (193), RAW_IMU (27) and SIMSTATE (164); PX4's are ESTIMATOR_STATUS
        (230), HIGHRES_IMU (105) and ALTITUDE (141).
        """
        self._streams = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: _Stream(r.heartbeat, rates.heartbeat),
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: _Stream(r.sys_status, rates.sys_status),
            mavlink.MAVLINK_MSG_ID_ATTITUDE: _Stream(r.attitude, rates.attitude),
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: _Stream(r.local_position, rates.local_position),
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _Stream(r.global_position, rates.global_position),
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: _Stream(r.origin, rates.gps_global_origin),
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: _Stream(
                r.position_target, rates.position_target
            ),
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _Stream(
                r.extended_sys_state, rates.extended_sys_state
            ),
        }
        if reports_ekf:
            self._streams[mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT] = _Stream(r.ekf_status, rates.ekf_status)
            self._streams[mavlink.MAVLINK_MSG_ID_RAW_IMU] = _Stream(n.raw_imu, 0.0)
            self._streams[mavlink.MAVLINK_MSG_ID_SIMSTATE] = _Stream(n.sim_state, 0.0)
        self._streams |= {
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: _Stream(q.system_time, rates.system_time),
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: _Stream(q.gps_raw, rates.gps_raw),
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _Stream(
                q.attitude_quaternion, rates.attitude_quaternion
            ),
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: _Stream(q.mission_current, rates.mission_current),
            mavlink.MAVLINK_MSG_ID_VFR_HUD: _Stream(q.vfr_hud, rates.vfr_hud),
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: _Stream(q.battery_status, rates.battery_status),
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: _Stream(q.autopilot_version, 0.0),
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: _Stream(q.home, rates.home_position),
            mavlink.MAVLINK_MSG_ID_FENCE_STATUS: _Stream(q.fence_status, 0.0),
        }
        self._streams |= {
            mavlink.MAVLINK_MSG_ID_SCALED_IMU: _Stream(n.scaled_imu, 0.0),
            mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: _Stream(n.scaled_pressure, 0.0),
            mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: _Stream(o.servo_output, 0.0),
            mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: _Stream(o.attitude_target, 0.0),
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: _Stream(o.position_target_global, 0.0),
            mavlink.MAVLINK_MSG_ID_RC_CHANNELS: _Stream(o.nothing, 0.0),
        }
        if reports_ekf:
            self._streams[mavlink.MAVLINK_MSG_ID_POWER_STATUS] = _Stream(o.nothing, 0.0)
        else:
            self._streams |= {
                mavlink.MAVLINK_MSG_ID_ODOMETRY: _Stream(o.odometry, 0.0),
                mavlink.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: _Stream(o.actuator_outputs, 0.0),
                mavlink.MAVLINK_MSG_ID_FLIGHT_INFORMATION: _Stream(o.flight_information, 0.0),
                mavlink.MAVLINK_MSG_ID_UTM_GLOBAL_POSITION: _Stream(o.utm_global_position, 0.0),
            }
        # Not among the messages that a client can set: ArduPilot refuses an interval of TIMESYNC.
        self._own = _Stream(o.timesync, 0.0)
        if not reports_ekf:
            self._streams[mavlink.MAVLINK_MSG_ID_TIMESYNC] = self._own
        if not reports_ekf:
            self._streams[mavlink.MAVLINK_MSG_ID_HIGHRES_IMU] = _Stream(n.highres_imu, 0.0)
            self._streams[mavlink.MAVLINK_MSG_ID_ALTITUDE] = _Stream(q.altitude, rates.altitude)
            self._streams[mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS] = _Stream(
                q.estimator_status, rates.estimator_status
            )
        # Active streams only: many are inactive, and a step need not check those.
        self._active: list[_Stream] = []
        self._requested: list[int] = []
        self.next_due = _NEVER

    def add(self, message_id: int, build: Build) -> None:
        """Add a message that is sent on request only."""
        self._streams[message_id] = _Stream(build, 0.0)

    def stream(self, rates: Mapping[int, float], timesync: float) -> None:
        """Set the usual rates (Hz) by message id, and that of TIMESYNC (111). Call it before ``start``."""
        for message_id, rate in rates.items():
            if message_id in self._streams:
                self._streams[message_id] = _Stream(self._streams[message_id].build, rate)
        self._own.usual = self._own.interval = round(1e6 / timesync)

    def silent(self, message_id: int) -> bool:
        """Return whether the firmware has this message, but the simulation has nothing to say in it."""
        stream = self._streams.get(message_id)
        return stream is not None and stream.build is o.nothing

    def start(self, now: int) -> None:
        """Make every stream that has an interval due at ``now`` (µs), and from then on once per interval."""
        for stream in (*self._streams.values(), self._own):
            stream.due = now if stream.interval else _NEVER
        self._gather()

    def set_interval(self, message_id: int, interval: int, now: int) -> bool:
        """Execute SET_MESSAGE_INTERVAL (511): ``interval`` in µs, 0 for the configured one, −1 for none.

        Return False if there is no such message.
        """
        stream = self._streams.get(message_id)
        if stream is None:
            return False
        wanted = max(0, stream.usual if interval == 0 else interval)
        if wanted != stream.interval:
            stream.interval = wanted
            stream.due = now + wanted if wanted else _NEVER
            self._gather()
        return True

    def interval(self, message_id: int) -> int:
        """Return the interval as in MESSAGE_INTERVAL (244): µs, −1 for none, 0 for an unknown message."""
        stream = self._streams.get(message_id)
        return 0 if stream is None else stream.interval or -1

    def request(self, message_id: int) -> bool:
        """Send one message at the next opportunity, independent of its stream.

        Return False if there is no such message.
        """
        if message_id not in self._streams:
            return False
        # One message answers all requests made before it is sent.
        if message_id not in self._requested:
            self._requested.append(message_id)
        self.next_due = 0
        return True

    def collect(self, now: int, snapshot: Snapshot) -> list[Message]:
        """Return all messages due at ``now`` (µs). A late stream skips the messages that it missed."""
        builds = [self._streams[message_id].build for message_id in self._requested]
        self._requested.clear()
        next_due = _NEVER
        for stream in self._active:
            due = stream.due
            if due <= now:
                builds.append(stream.build)
                due += stream.interval
                if due <= now:
                    due += (now - due) // stream.interval * stream.interval + stream.interval
                stream.due = due
            if due < next_due:
                next_due = due
        self.next_due = next_due
        return [message for build in builds if (message := build(snapshot)) is not None]

    def _gather(self) -> None:
        streams = dict.fromkeys((*self._streams.values(), self._own))
        self._active = [stream for stream in streams if stream.interval]
        self._schedule()

    def _schedule(self) -> None:
        dues = (stream.due for stream in self._active)
        self.next_due = 0 if self._requested else min(dues, default=_NEVER)
