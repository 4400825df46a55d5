"""Requests that the doctor sends on a live link: few, slow, and without effect on the vehicle.

It sends HEARTBEAT, REQUEST_MESSAGE and PARAM_REQUEST_READ, and asks a disarmed vehicle whose pre-arm check
fails for the reasons. It sets no rate: REQUEST_MESSAGE also shows whether a message exists, and other
receivers keep the rates that they have requested.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from companion.telemetry.sharing import onboard_heartbeat
from mavlink_bridge.messages import CommandLong, Message, ParamRequestRead, Source
from outrider.doctor.cameras import cameras_of
from outrider.doctor.examination import Examination
from outrider.doctor.objections import Objections
from outrider.doctor.sender_record import SenderRecord
from outrider.doctor.settings import names

COMPONENT: Final[int] = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER3
"""Component id of the doctor.

It is not a ground station: FS_GCS_ENABLE and NAV_DLL_ACT act when a ground station's HEARTBEAT, once
received, is lost. It is not 195, the id of ``fly``: others would take the doctor for a companion.
"""
STRANGER: Final = Source(245, COMPONENT)
"""Sender id before the vehicle's system id is known.

The doctor sends its HEARTBEAT even then, because an autopilot may send nothing before it receives a message.
"""
_HEARTBEAT_INTERVAL_US: Final = 1_000_000
_REPEAT_INTERVAL_US: Final = 700_000
"""Time until a request is repeated (µs)."""
_STREAM_WAIT_US: Final = 2_000_000
"""Time to wait for streams that arrive without a request (µs), before they are requested."""
_MAX_REQUESTS: Final = 3
_MAX_REQUESTS_PER_STEP: Final = 2
"""Maximum number of requests in one step: 57 600 baud carry a hundred a second, but also other traffic."""
_RARELY_STREAMED: Final = (
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION,
)
"""Requested immediately, as they are rarely streamed."""
_STREAMED: Final = (
    mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
)
_CLOCK: Final[int] = mavlink.MAVLINK_MSG_ID_SYSTEM_TIME
_MIN_STAMPS: Final = 20
"""Fewer time stamps say too little of the clock: ArduPilot streams none before a request."""
_MAX_CLOCK_REQUESTS: Final = 7
_CAMERA: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION
_ESTIMATOR: Final = {
    True: mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
    False: mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
}
"""Id of the estimator's status message, by whether the autopilot is PX4."""


class _Asked(NamedTuple):
    times: int
    last: int


class Questions:
    """Requests to one vehicle; ``examination`` identifies the vehicle and holds the answers."""

    def __init__(self, examination: Examination) -> None:
        self._examination = examination
        self._asked: dict[int | str, _Asked] = {}
        self._asked_cameras: dict[Source, _Asked] = {}
        self._clock = _Asked(0, 0)
        self._objections = Objections()
        self._met_at: int | None = None
        self._addressee: Source | None = None
        self._beat: int | None = None
        self.me = STRANGER

    def due(self, now: int) -> list[Message]:
        """Return the messages to send at ``now`` (µs)."""
        vehicle = self._examination.vehicle
        if vehicle is not None:
            if vehicle.source != self._addressee:
                # A vehicle with a lower id was received: start again with it.
                self._addressee, self._met_at = vehicle.source, now
                self._asked.clear()
                self._examination.asked.clear()
                self._clock = _Asked(0, 0)
                self._objections = Objections()
            self.me = self._examination.me = Source(vehicle.source.system, COMPONENT)
        said: list[Message] = []
        if self._beat is None or now - self._beat >= _HEARTBEAT_INTERVAL_US:
            self._beat = now
            said.append(onboard_heartbeat(self.me))
        if vehicle is not None:
            said += self._ask_cameras(vehicle, now)
            open_ones = [key for key in self._wanted(vehicle, now) if self._is_open(key, vehicle, now)]
            said += [self._ask(key, vehicle, now) for key in open_ones[:_MAX_REQUESTS_PER_STEP]]
            said += self._ask_clock(vehicle, now)
            said += self._objections.due(vehicle, self.me, now)
        return said

    def done(self, now: int) -> bool:
        """Return whether every request was answered, or sent three times and then given 0.7 s for an answer.

        False until 2 s have passed since the vehicle was first received, and while the clock is being read.
        """
        vehicle = self._examination.vehicle
        if vehicle is None or self._met_at is None or now - self._met_at < _STREAM_WAIT_US:
            return False
        return not self._clock_open(vehicle, now) and not any(
            self._asked.get(key, _Asked(0, 0)).times < _MAX_REQUESTS
            or now - self._asked[key].last < _REPEAT_INTERVAL_US
            for key in self._wanted(vehicle, now)
            if not _answered(key, vehicle)
        )

    def listening(self, now: int) -> int:
        """Return the longest time (µs) left to wait for the reasons of a failed pre-arm check."""
        vehicle = self._examination.vehicle
        return 0 if vehicle is None else self._objections.left(vehicle, now)

    def _ask_cameras(self, vehicle: SenderRecord, now: int) -> list[Message]:
        """Return requests for CAMERA_INFORMATION to the vehicle's cameras that have not sent it."""
        said: list[Message] = []
        for camera in cameras_of(self._examination.hearing, vehicle.source.system):
            times, last = self._asked_cameras.get(camera.source, _Asked(0, 0))
            waits = times and now - last < _REPEAT_INTERVAL_US
            if _CAMERA in camera.streams or times >= _MAX_REQUESTS or waits:
                continue
            self._asked_cameras[camera.source] = _Asked(times + 1, now)
            params = (float(_CAMERA), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            said.append(CommandLong(self.me, *camera.source, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, params))
        return said

    def _ask_clock(self, vehicle: SenderRecord, now: int) -> list[Message]:
        """Return a request for another SYSTEM_TIME, if what streams has too few time stamps."""
        if not self._clock_open(vehicle, now) or self._clock.times == _MAX_CLOCK_REQUESTS:
            return []
        if self._clock.times and now - self._clock.last < _REPEAT_INTERVAL_US:
            return []
        self._clock = _Asked(self._clock.times + 1, now)
        return [self._request(_CLOCK, vehicle)]

    def _clock_open(self, vehicle: SenderRecord, now: int) -> bool:
        """Return whether the clock is still being read: only of a vehicle that tells its time at all."""
        if self._met_at is None or now - self._met_at < _STREAM_WAIT_US or _CLOCK not in vehicle.streams:
            return False
        if vehicle.clock.stamps >= _MIN_STAMPS:
            return False
        return self._clock.times < _MAX_CLOCK_REQUESTS or now - self._clock.last < _REPEAT_INTERVAL_US

    def _wanted(self, vehicle: SenderRecord, now: int) -> tuple[int | str, ...]:
        px4 = vehicle.is_px4
        wanted: tuple[int | str, ...] = _RARELY_STREAMED + names(px4=px4)
        if self._met_at is not None and now - self._met_at >= _STREAM_WAIT_US:
            wanted += (*_STREAMED, _ESTIMATOR[px4])
        return wanted

    def _is_open(self, key: int | str, vehicle: SenderRecord, now: int) -> bool:
        times, last = self._asked.get(key, _Asked(0, 0))
        return (
            not _answered(key, vehicle)
            and times < _MAX_REQUESTS
            and (times == 0 or now - last >= _REPEAT_INTERVAL_US)
        )

    def _ask(self, key: int | str, vehicle: SenderRecord, now: int) -> Message:
        times, _ = self._asked.get(key, _Asked(0, 0))
        self._asked[key] = _Asked(times + 1, now)
        if isinstance(key, str):
            return ParamRequestRead(self.me, -1, *vehicle.source, key)
        return self._request(key, vehicle)

    def _request(self, key: int, vehicle: SenderRecord) -> Message:
        self._examination.asked[key] = self._examination.asked.get(key, 0) + 1
        system, component = vehicle.source
        params = (float(key), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return CommandLong(self.me, system, component, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, params)


def _answered(key: int | str, vehicle: SenderRecord) -> bool:
    return key in vehicle.parameters if isinstance(key, str) else key in vehicle.streams
