"""Conditions for a start, and the requests to the autopilot for the messages that they need."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.autopilot_limits import AutopilotLimits
from companion.flight.autopilots import Params
from companion.flight.command_protocol import Commands
from companion.flight.vehicle import Vehicle
from companion.world import View
from mavlink_bridge.messages import CommandAck, Message

OPERATORS_GO = "the operator's go"
"""Value of ``missing`` when everything else is ready."""
_BESIDE = 30.0
"""m; largest distance outside the box, on each axis, at which a vehicle may start."""
_FAR = 20_000.0
"""m between the fleet origin and the autopilot's own: beyond this, one of the two is wrong."""
STREAMS: Mapping[int, int] = MappingProxyType(
    {
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 20_000,
        mavlink.MAVLINK_MSG_ID_ATTITUDE: 100_000,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1_000_000,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 500_000,
    }
)
"""Requested message ids and intervals (µs).

The attitude is used only for the direction of the nose when the set-points begin.
"""
HEALTH = 500_000
"""Interval (µs) of GPS_RAW_INT and of the message with the estimator's status.

A start does not require them: a vehicle may have neither.
"""


def _interval(message: int, interval: int) -> tuple[int, Params]:
    params = (float(message), float(interval), 0.0, 0.0, 0.0, 0.0, 0.0)
    return mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, params


_NEEDED = tuple(_interval(message, interval) for message, interval in STREAMS.items())


class Readiness:
    """Readiness of one ``vehicle``; ``calls`` sends the commands to its autopilot."""

    def __init__(self, config: CompanionConfig, vehicle: Vehicle, calls: Commands) -> None:
        self._config = config
        self._vehicle = vehicle
        self._commands = calls
        self._requests = Commands(calls.own)
        self.limits = AutopilotLimits(config, vehicle, calls.own)

    def receive(self, ack: CommandAck) -> None:
        """Receive an acknowledgement of the autopilot."""
        self._requests.receive(ack)

    def forget(self) -> None:
        """Forget all requests and answers."""
        self._requests.forget()
        self.limits.forget()

    @property
    def received(self) -> bool:
        """Whether the autopilot has answered the requests for all required messages."""
        return all(self._commands.answered(*call) for call in _NEEDED)

    def wishes(self, now: int) -> list[Message]:
        """Return requests for the messages about the quality of the vehicle's position.

        They follow the required ones, because an acknowledgement contains the command id alone.
        """
        profile = self._vehicle.profile
        if profile is None or not self._vehicle.alive:
            return []
        health = mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, profile.estimator_message
        wanted = [_interval(message, HEALTH) for message in health]
        open_ = [call for call in wanted if not self._requests.answered(*call)]
        return self._requests.call(now, *open_[0]) if open_ else []

    def unseen(self, view: View) -> str:
        """Return the missing input that every plan needs, or an empty string."""
        vehicle = self._vehicle
        if vehicle.heartbeat is None or not vehicle.alive:
            return "a heartbeat of the autopilot"
        if vehicle.profile is None:
            kind = vehicle.heartbeat.autopilot
            return f"an autopilot that is known (ArduPilot 3, PX4 12; this is {kind})"
        if view.local is None:
            return "GPS_GLOBAL_ORIGIN"
        far = float(np.linalg.norm(view.local.origin_fleet))
        if not far < _FAR:
            return f"a fleet origin that is not {far / 1000.0:.0f} km away from the vehicle's"
        if view.own is None or view.own.age > self._config.guard.own_stale_us:
            return "LOCAL_POSITION_NED"
        return "" if view.yaw is not None else "ATTITUDE"

    def missing(self, view: View, *, go: bool) -> str:
        """Return the condition that is missing for a start, or an empty string.

        ``go``: whether the operator's go was given.
        """
        vehicle = self._vehicle
        if unseen := self.unseen(view):
            return unseen
        if astray := self._astray(view):
            return astray
        if vehicle.armed and vehicle.landed_state == mavlink.MAV_LANDED_STATE_UNDEFINED:
            # A vehicle that may be flying must not receive a take-off command.
            return "EXTENDED_SYS_STATE, whether the armed vehicle is on the ground"
        if not vehicle.healthy:
            return f"the autopilot's pre-arm checks{self._starving()}"
        if not self.received:
            return "the autopilot's answers to SET_MESSAGE_INTERVAL"
        if waiting := self.limits.waiting:
            return waiting
        return "" if go else OPERATORS_GO

    def _starving(self) -> str:
        """Return the reason why the checks fail if it is the mode, otherwise an empty string."""
        profile = self._vehicle.profile
        if profile is None or not self._vehicle.starved:
            return ""
        return f", which fail in {profile.guided_name} without set-points: {profile.hold_name} first"

    def _astray(self, view: View) -> str:
        """Return the reason against a start here, or an empty string.

        A position far from the box cannot be intended: then the fleet origin is wrong, or the vehicle's. A
        low battery is a reason, too.
        """
        limits, guard = self._config.limits, self._config.guard
        if view.own is None:
            return ""
        place = view.own.position
        x, y, z = place.tolist()
        off = np.maximum(np.array(limits.box_min) - place, place - np.array(limits.box_max))
        far = guard.fence_radius is not None and x * x + y * y > guard.fence_radius**2
        if far or not float(off.max()) <= _BESIDE:
            return f"a start near the box: it is at {x:.0f} m east, {y:.0f} m north, {z:.0f} m up"
        status, low = self._vehicle.status, guard.battery_low
        left = None if status is None else status.battery_remaining
        return "" if left is None or left >= low else f"a battery above {100 * low:.0f} %"

    def requests(self, now: int) -> list[Message]:
        """Return requests for the required messages and parameters.

        These do not affect the vehicle's behaviour.

        In addition, request the mode in which a disarmed vehicle passes its checks.
        """
        calls: list[Message] = []
        profile, vehicle = self._vehicle.profile, self._vehicle
        if profile is not None and vehicle.alive and vehicle.starved and not vehicle.healthy:
            # If another controller sends set-points the checks pass, and the mode is that controller's.
            calls += self._commands.call(now, mavlink.MAV_CMD_DO_SET_MODE, profile.hold_call)
        if self._vehicle.heartbeat is not None:
            for command, params in sorted(_NEEDED, key=lambda call: self._commands.sent_at(*call)):
                calls += self._commands.call(now, command, params)
            # Repeated from time to time: an autopilot that restarted elsewhere has another origin.
            origin = (mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            calls += self._commands.call(now, mavlink.MAV_CMD_REQUEST_MESSAGE, origin)
        return calls + self.limits.step(now)
