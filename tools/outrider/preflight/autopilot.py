"""Figures of the own autopilot: accuracy of its position, and parameters that a certified flight needs."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilots import Profile
from companion.flight.autopilots.known import profile_of
from companion.flight.autopilots.limits import stock_parameters
from companion.flight.positioning import Positioning
from companion.telemetry.sharing import onboard_heartbeat
from mavlink_bridge.messages import (
    CommandLong,
    EkfStatus,
    EstimatorStatus,
    GpsRaw,
    Heartbeat,
    Message,
    ParamRequestRead,
    ParamValue,
    Source,
    SystemTime,
)
from mavlink_bridge.wire.param_value import number_of

TIMEOUTS: Final = {
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "GUID_TIMEOUT",
    mavlink.MAV_AUTOPILOT_PX4: "COM_OF_LOSS_T",
}
"""Parameter with the time (s) without set-points after which the autopilot acts, by MAV_AUTOPILOT."""
RECEIVED: Final = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
    )
)
_HEARTBEAT_US: Final = 1_000_000
_RETRY_US: Final = 500_000
_PATIENCE_US: Final = 5_000_000
"""Time (µs) from the first request after which parameters that were not answered are not waited for."""
_STREAM_US: Final = 500_000
"""Requested interval (µs) of the messages about the position."""
_LOST_US: Final = 3_000_000
"""Age (µs) of the last heartbeat from which on the autopilot counts as lost."""


class AutopilotFigures:
    """What the autopilot of ``own``'s system tells; ``utc``: SYSTEM_TIME is requested as well.

    ``sigma`` (m): the largest accuracy that receiver or estimator has reported since ``begin``; None
    without any. Heights do not count if ``planar``.
    """

    def __init__(self, own: Source, *, planar: bool, utc: bool) -> None:
        self._own, self._planar, self._utc = own, planar, utc
        self.profile: Profile | None = None
        self.parameters: dict[str, float] = {}
        self.sigma: float | None = None
        self.trouble = ""
        """Why the position was not reliable at some time since ``begin``; empty if it always was."""
        self._positioning = Positioning()
        self._received: dict[type[Message], int] = {}
        self._since: int | None = None
        self._heard: int | None = None
        self._armed = False
        self._next_beat = self._next_request = 0

    def receive(self, now: int, message: Message) -> None:
        """Receive a message of the autopilot at ``now`` (µs)."""
        self._received[type(message)] = now
        match message:
            case Heartbeat():
                self._heard, self.profile = now, profile_of(message)
                self._armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                self._since = now if self._since is None else self._since
            case ParamValue() if message.name in self._names() and self.profile is not None:
                value = number_of(message, bytewise=self.profile.bytewise)
                if value is not None:
                    self.parameters[message.name] = value
            case GpsRaw():
                self._add(message.horizontal_accuracy, message.vertical_accuracy)
            case EstimatorStatus():
                self._add(message.horizontal_accuracy, message.vertical_accuracy)
        if isinstance(message, GpsRaw | EkfStatus | EstimatorStatus):
            self._positioning.receive(message)

    def _add(self, horizontal: float, vertical: float) -> None:
        """Add accuracies (m); 0 and NaN mean unknown."""
        for accuracy in (horizontal,) if self._planar else (horizontal, vertical):
            if accuracy > 0.0:
                self.sigma = accuracy if self.sigma is None else max(self.sigma, accuracy)

    def begin(self) -> None:
        """Begin to measure: forget the accuracies and the trouble so far."""
        self.sigma, self.trouble = None, ""

    def tick(self, now: int) -> None:
        """Bring ``trouble`` up to date at ``now`` (µs)."""
        self._positioning.tick(now)
        self.trouble = self.trouble or self._positioning.trouble

    def lacking(self, now: int) -> str:
        """Return what has not been received yet, or an empty string."""
        if self._heard is None or now - self._heard > _LOST_US:
            return f"a heartbeat of the autopilot of vehicle {self._own.system}"
        if self.profile is None:
            return "an autopilot that is known (ArduPilot, PX4)"
        late = self._since is not None and now - self._since > _PATIENCE_US
        return "" if late or not self.unread else "the autopilot's parameters"

    def disarmed(self, now: int) -> bool:
        """Return whether a heartbeat of the last seconds before ``now`` (µs) says that it is disarmed."""
        return self._heard is not None and now - self._heard <= _LOST_US and not self._armed

    @property
    def unread(self) -> tuple[str, ...]:
        """Names of the parameters that were not answered."""
        return tuple(name for name in self._names() if name not in self.parameters)

    def _names(self) -> tuple[str, ...]:
        if self.profile is None:
            return ()
        number = self.profile.autopilot
        return (*stock_parameters(number), TIMEOUTS[number])

    def requests(self, now: int) -> list[Message]:
        """Return the heartbeat and the requests that are due at ``now`` (µs)."""
        found: list[Message] = []
        if now >= self._next_beat:
            self._next_beat = now + _HEARTBEAT_US
            found.append(onboard_heartbeat(self._own))
        if self.profile is None or now < self._next_request:
            return found
        self._next_request = now + _RETRY_US
        target = self._own.system, mavlink.MAV_COMP_ID_AUTOPILOT1
        found += [ParamRequestRead(self._own, -1, *target, name) for name in self.unread]
        wanted: list[tuple[type[Message], int]] = [(GpsRaw, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT)]
        estimator = self.profile.estimator_message
        px4 = estimator == mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
        wanted.append((EstimatorStatus if px4 else EkfStatus, estimator))
        if self._utc:
            wanted.append((SystemTime, mavlink.MAVLINK_MSG_ID_SYSTEM_TIME))
        for kind, number in wanted:
            if now - self._received.get(kind, -_LOST_US) >= _LOST_US:
                params = (float(number), float(_STREAM_US), 0.0, 0.0, 0.0, 0.0, 0.0)
                command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
                found.append(CommandLong(self._own, *target, command, 0, params))
        return found
