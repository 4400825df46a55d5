"""Conditions for a start, and requests to the autopilot for the messages needed to check them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.autopilot_limits import AutopilotLimits
from companion.flight.autopilots import Params, Profile
from companion.flight.command_protocol import Commands
from companion.flight.vehicle import Vehicle
from companion.world import View
from mavlink_bridge.frames import LocalFrame
from mavlink_bridge.messages import CommandAck, CommandLong, Message

OPERATORS_GO = "the operator's go"
"""Value of ``missing`` when everything else is ready."""
_MAX_OUTSIDE_BOX = 30.0
"""m; largest distance outside the box of ``limits``, on each axis, at which a vehicle may start."""
_MAX_ORIGIN_DISTANCE = 20_000.0
"""m between the fleet origin and the autopilot's local origin; from here on, one of the two is wrong."""
STREAMS: Mapping[int, int] = MappingProxyType(
    {
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 20_000,
        mavlink.MAVLINK_MSG_ID_ATTITUDE: 100_000,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1_000_000,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 500_000,
    }
)
"""Required message ids and the intervals (µs) that are requested.

ATTITUDE gives the yaw: the heading when set-points begin and in shared positions, and the direction of sensor
data.
"""
HEALTH = 500_000
"""Interval (µs) of GPS_RAW_INT and of the message with the estimator's status.

A start does not require them: a vehicle may have neither.
"""
SLOW_STREAMS: Mapping[int, int] = MappingProxyType(
    {
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 250_000,
        mavlink.MAVLINK_MSG_ID_ATTITUDE: 250_000,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1_000_000,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1_000_000,
    }
)
"""The same as ``STREAMS`` for who only looks on: enough for planning, and little for a radio."""
SLOW_HEALTH = 1_000_000
"""The same as ``HEALTH`` for who only looks on."""

UTC = 1_000_000
"""Interval (µs) of SYSTEM_TIME, which is requested where it is a source of fleet time."""
_ORIGIN_US = 10_000_000
"""Time (µs) between two requests for the origin in flight."""
_CONFIRM_US = 2_100_000
"""Time (µs) from a change of the origin to the next request; ``Origins`` refuses earlier ones for 2 s."""
_ORIGIN_CALL = (
    mavlink.MAV_CMD_REQUEST_MESSAGE,
    (float(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)


def _interval(message: int, interval: int) -> tuple[int, Params]:
    params = (float(message), float(interval), 0.0, 0.0, 0.0, 0.0, 0.0)
    return mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, params


@lru_cache
def _optional_requests(estimator_message: int, health: int, utc: bool) -> tuple[tuple[int, Params], ...]:
    messages = mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, estimator_message
    quality = [_interval(message, health) for message in messages]
    return (*quality, *([_interval(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, UTC)] if utc else ()))


class Readiness:
    """Readiness of one ``vehicle``; ``calls``: the protocol that sends commands to its autopilot.

    ``slow``: the messages are requested at the rates of ``SLOW_STREAMS``. ``arriving``: ids of messages that
    arrive already, whose rate is left as it is; a caller that wants all of its own rates leaves it empty.
    """

    def __init__(
        self, config: CompanionConfig, vehicle: Vehicle, calls: Commands, *, slow: bool = False
    ) -> None:
        streams = SLOW_STREAMS if slow else STREAMS
        self._required = tuple(_interval(message, interval) for message, interval in streams.items())
        self._health = SLOW_HEALTH if slow else HEALTH
        self.arriving: Set[int] = frozenset()
        self._config = config
        self._vehicle = vehicle
        self._commands = calls
        self._requests = Commands(calls.own)
        # The profile of the autopilot that has answered all requests of ``wishes``.
        self._fulfilled: Profile | None = None
        certified = config.certified
        self._utc = certified.fleet_time == "measured" and certified.time_sources.autopilot_us is not None
        self.limits = AutopilotLimits(config, vehicle, calls.own)
        self._local: LocalFrame | None = None
        self._confirm_at = 0

    def receive(self, ack: CommandAck) -> None:
        """Receive an acknowledgement of the autopilot, for the requests of ``wishes``."""
        self._requests.receive(ack)

    def forget(self) -> None:
        """Forget the requests of ``wishes`` and the parameters; ``calls`` is not reset."""
        self._requests.forget()
        self._fulfilled = None
        self.limits.forget()

    @property
    def received(self) -> bool:
        """Whether the autopilot has accepted or refused the request for each required message."""
        return all(self._commands.answered(*call) for call in self._wanted(self._required))

    def _wanted(self, calls: Sequence[tuple[int, Params]]) -> list[tuple[int, Params]]:
        """Return the requests without those for messages that are ``arriving``."""
        return [call for call in calls if int(call[1][0]) not in self.arriving]

    def wishes(self, now: int) -> list[Message]:
        """Return the next request for the messages about position quality and time, if one is due.

        The caller must wait until ``received`` is true: an acknowledgement contains the command id alone, and
        required and optional messages are requested by the same command.
        """
        profile = self._vehicle.profile
        if profile is None or profile is self._fulfilled or not self._vehicle.alive:
            return []
        for call in self._wanted(_optional_requests(profile.estimator_message, self._health, self._utc)):
            if not self._requests.answered(*call):
                return self._requests.call(now, *call)
        if not self.arriving:
            self._fulfilled = profile
        return []

    def unseen(self, view: View) -> str:
        """Return the first missing input that every plan needs, or an empty string."""
        vehicle = self._vehicle
        if vehicle.heartbeat is None or not vehicle.alive:
            return "a heartbeat of the autopilot"
        if vehicle.profile is None:
            kind = vehicle.heartbeat.autopilot
            return f"an autopilot that is known (ArduPilot 3, PX4 12; this is {kind})"
        if view.local is None:
            return "GPS_GLOBAL_ORIGIN"
        far = float(np.linalg.norm(view.local.origin_fleet))
        if not far < _MAX_ORIGIN_DISTANCE:
            return f"a fleet origin that is not {far / 1000.0:.0f} km away from the vehicle's"
        if view.own is None or view.own.age > self._config.guard.own_stale_us:
            return "LOCAL_POSITION_NED"
        return "" if view.yaw is not None else "ATTITUDE"

    def missing(self, view: View, *, go: bool) -> str:
        """Return the first condition for a start that is not met, or an empty string.

        ``go``: whether the operator's go was given.
        """
        vehicle = self._vehicle
        if unseen := self.unseen(view):
            return unseen
        if unfit := self._unfit_for_start(view):
            return unfit
        if vehicle.armed and vehicle.landed_state == mavlink.MAV_LANDED_STATE_UNDEFINED:
            # The armed vehicle may be flying, and must then not receive a take-off command.
            return "EXTENDED_SYS_STATE, whether the armed vehicle is on the ground"
        if not vehicle.healthy:
            return f"the autopilot's pre-arm checks{self._mode_reason()}"
        if not self.received:
            return "the autopilot's answers to SET_MESSAGE_INTERVAL"
        if waiting := self.limits.waiting:
            return waiting
        return "" if go else OPERATORS_GO

    def _mode_reason(self) -> str:
        """Return the text to append if the mode makes the pre-arm checks fail, or an empty string."""
        profile = self._vehicle.profile
        if profile is None or not self._vehicle.starved:
            return ""
        return f", which fail in {profile.guided_name} without set-points: {profile.hold_name} first"

    def _unfit_for_start(self, view: View) -> str:
        """Return the missing condition of position or battery, or an empty string.

        A start far from the box or outside the fence cannot be intended: the fleet origin or the vehicle's
        origin is wrong.
        """
        limits, guard = self._config.limits, self._config.guard
        if view.own is None:
            return ""
        place = view.own.position
        x, y, z = place.tolist()
        off = np.maximum(np.array(limits.box_min) - place, place - np.array(limits.box_max))
        far = guard.fence_radius is not None and x * x + y * y > guard.fence_radius**2
        if far or not float(off.max()) <= _MAX_OUTSIDE_BOX:
            return f"a start near the box: it is at {x:.0f} m east, {y:.0f} m north, {z:.0f} m up"
        status, low = self._vehicle.status, guard.battery_low
        left = None if status is None else status.battery_remaining
        return "" if left is None or left >= low else f"a battery above {100 * low:.0f} %"

    def requests(self, now: int) -> list[Message]:
        """Return requests for the required messages, the origin and the parameters, and a mode command.

        Only the mode command affects the vehicle's behaviour: a disarmed vehicle whose pre-arm checks fail in
        guided mode without set-points is sent to the hold mode.
        """
        calls: list[Message] = []
        profile, vehicle = self._vehicle.profile, self._vehicle
        if profile is not None and vehicle.alive and vehicle.starved and not vehicle.healthy:
            # If another controller sends set-points, the checks pass and the mode is not changed.
            calls += self._commands.call(now, mavlink.MAV_CMD_DO_SET_MODE, profile.hold_call)
        if self._vehicle.heartbeat is not None:
            for command, params in sorted(
                self._wanted(self._required), key=lambda call: self._commands.sent_at(*call)
            ):
                calls += self._commands.call(now, command, params)
            # Repeated by ``Commands`` after 15 s: an autopilot that restarted elsewhere has another origin.
            calls += self._commands.call(now, *_ORIGIN_CALL)
        return calls + self.limits.step(now)

    def confirm_origin(self, now: int, view: View) -> list[Message]:
        """Return the request for the origin in flight, if it is due.

        It is due every 10 s, because the message about a new origin may be lost, and soon after a change of
        the origin, because the message may have been an old one: as soon as ``Origins`` takes back an
        earlier origin.
        """
        if view.local is not self._local:
            # Before the flight the origin was requested all the time.
            self._confirm_at = now + (_ORIGIN_US if self._local is None else _CONFIRM_US)
            self._local = view.local
        if now < self._confirm_at or not self._vehicle.alive:
            return []
        self._confirm_at = now + _ORIGIN_US
        # Whether it is acknowledged makes no difference: the next request is as good as a repetition.
        command, params = _ORIGIN_CALL
        target = self._commands.own.system, mavlink.MAV_COMP_ID_AUTOPILOT1
        return [CommandLong(self._commands.own, *target, command, 0, params)]
