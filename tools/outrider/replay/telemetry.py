"""Telemetry of a log, sent to a live link: reports of vehicles, never requests or commands.

A log also holds the commands, set-points, parameters and missions of ground stations; sent again they would
fly a real vehicle. So messages are selected by a list of those that request nothing. A component's messages
are sent only after a heartbeat of it, if its last heartbeat is not a ground station's.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.links.link import Link
from mavlink_bridge.tlog.log import Record
from mavlink_bridge.wire.framing import without_signature
from mavlink_bridge.wire.header import header
from outrider.logs.timeline import IDLE, on_one_line

# Messages that an autopilot takes as sensor input are left out: ODOMETRY, DISTANCE_SENSOR, ADSB_VEHICLE,
# SYSTEM_TIME and similar. GLOBAL_POSITION_INT is included, so a vehicle in a follow mode may follow a
# recorded vehicle.
TELEMETRY: Final = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_GPS2_RAW,
        mavlink.MAVLINK_MSG_ID_RAW_IMU,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU2,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE,
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
        mavlink.MAVLINK_MSG_ID_VFR_HUD,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
        mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
        mavlink.MAVLINK_MSG_ID_ALTITUDE,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION,
        mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        mavlink.MAVLINK_MSG_ID_VIBRATION,
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
        mavlink.MAVLINK_MSG_ID_WIND,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
        mavlink.MAVLINK_MSG_ID_TERRAIN_REPORT,
        mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT,
    )
)
"""Ids of messages that report and request nothing."""
_TYPE_OFFSET = 4
"""Offset of MAV_TYPE in a HEARTBEAT's payload."""
_PAYLOAD_OFFSETS: Final[dict[int, int]] = {
    mavlink.PROTOCOL_MARKER_V1: mavlink.HEADER_LEN_V1,
    mavlink.PROTOCOL_MARKER_V2: mavlink.HEADER_LEN_V2,
}
"""Offset of the payload in a frame by the frame's first byte."""


class Forwarder:
    """Sender of the telemetry among records to ``link``."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._vehicles: set[tuple[int, int]] = set()
        self.sent = self.kept = 0
        """Numbers of frames that were sent, and that were not."""

    def take(self, frame: bytes) -> None:
        """Send ``frame``, without its signature, if it is a vehicle's telemetry."""
        # A listening link learns its destinations from what it receives; the content is ignored.
        self._link.receive()
        system, component, message_id = header(frame)
        if message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            kind = (
                frame[_PAYLOAD_OFFSETS[frame[0]] + _TYPE_OFFSET]
                if len(frame) > _PAYLOAD_OFFSETS[frame[0]] + _TYPE_OFFSET
                else 0
            )
            if kind == mavlink.MAV_TYPE_GCS:
                self._vehicles.discard((system, component))
            else:
                self._vehicles.add((system, component))
        if message_id in TELEMETRY and (system, component) in self._vehicles:
            self._link.send(without_signature(frame))
            self.sent += 1
        else:
            self.kept += 1


def paced(
    records: Iterable[Record], clock: Clock, speed: float | None, forwarder: Forwarder | None = None
) -> Iterator[Record]:
    """Yield the records on one time line (see ``timeline``), each no earlier than its time.

    ``speed`` is a multiple of the log's (None: without waiting). Silence is shortened to 5 s of the log.
    ``forwarder`` takes each record's frame when it is due.
    """
    before: int | None = None
    due = clock.now()
    for record in on_one_line(records):
        if speed is not None and before is not None:
            due += round(min(record.time - before, IDLE) / speed)
            clock.wait_until(due)
        before = record.time
        if forwarder is not None:
            forwarder.take(record.frame)
        yield record
