"""Reader of a vehicle's tlog: one pass collects everything that the report uses."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.frames import ned_to_enu
from mavlink_bridge.messages import (
    CameraFovStatus,
    CameraTrackingGeo,
    CommandAck,
    Heartbeat,
    LocalPosition,
    Message,
    StatusText,
)
from mavlink_bridge.tlog.log import Record, TlogReport, read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.report.run import CameraMessage, EventMessage, Log, Sender, Stream, Times
from outrider.runs import names

SWARM = names.LINK_NUMBERS["swarm"]
_DECODED = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
    mavlink.MAVLINK_MSG_ID_STATUSTEXT,
    mavlink.MAVLINK_MSG_ID_CAMERA_FOV_STATUS,
    mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS,
}
_MAX_TIME_US = 1 << 62
"""Latest time (µs): a damaged time stamp may exceed a 64-bit integer."""
_PROGRESS_RECORDS = 4096
"""Number of records between two progress reports."""


def read_log(owner: int, path: Path, at: Callable[[int], None] = lambda _bytes: None) -> Log:
    """Read the log of vehicle ``owner``. Raises LogError.

    ``at`` is called with the number of bytes read.
    """
    pass_ = _Pass(owner)
    reader, size = read_tlog(path), 0
    for number, record in enumerate(reader):
        size += 8 + len(record.frame)
        if number % _PROGRESS_RECORDS == 0:
            at(size)
        pass_.see(record)
    return pass_.log(reader.report)


def sequence_and_sender(frame: bytes) -> tuple[int, Sender]:
    """Return the sequence number (0…255) and the sender from the header of a whole frame."""
    if frame[0] == mavlink.PROTOCOL_MARKER_V2:
        return frame[4], Sender(frame[5], frame[6])
    return frame[2], Sender(frame[3], frame[4])


class _StreamBuffer:
    """Buffer of a stream: 17 bytes for each message of any length."""

    def __init__(self) -> None:
        self._time, self._sequence, self._mark = array("q"), array("B"), array("q")

    def add(self, time: int, sequence: int, frame: bytes) -> None:
        self._time.append(time)
        self._sequence.append(sequence)
        self._mark.append(hash(frame))

    def stream(self) -> Stream:
        sequence = np.array(self._sequence, dtype=np.uint8)
        return Stream(_whole(self._time), sequence, _whole(self._mark))


def _whole(values: Iterable[int]) -> Times:
    return np.array(values, dtype=np.int64)


class _Pass:
    def __init__(self, owner: int) -> None:
        self._owner = owner
        self._begin = self._end = 0
        self._first = True
        self._sent = _StreamBuffer()
        self._received: dict[Sender, _StreamBuffer] = {}
        self._codec = Codec(lambda identifier, system, _component: identifier in _DECODED and system == owner)
        self._moments = array("q")
        self._speeds = array("d")
        self._utterances: list[EventMessage] = []
        self._seen: list[CameraMessage] = []

    def see(self, record: Record) -> None:
        """Process the next record."""
        time = min(record.time, _MAX_TIME_US)
        if self._first:
            self._begin = self._end = time
            self._first = False
        self._end = max(self._end, time)
        if record.link == SWARM:
            sequence, sender = sequence_and_sender(record.frame)
            if sender.system == self._owner:
                self._sent.add(time, sequence, record.frame)
            else:
                self._received.setdefault(sender, _StreamBuffer()).add(time, sequence, record.frame)
            return
        for message in self._codec.feed(record.frame):
            self._receive(time, message)

    def _receive(self, time: int, message: Message) -> None:
        """Store a message of the own vehicle outside the swarm link.

        The companion's answers to the operator have another component id than the autopilot; they are stored
        too.
        """
        if isinstance(message, LocalPosition):
            if message.source.component == mavlink.MAV_COMP_ID_AUTOPILOT1:
                self._moments.append(time)
                self._speeds.extend(message.velocity_ned)
        elif isinstance(message, Heartbeat):
            if message.source.component == mavlink.MAV_COMP_ID_AUTOPILOT1:
                self._utterances.append(EventMessage(time, message))
        elif isinstance(message, CameraFovStatus | CameraTrackingGeo):
            self._seen.append(CameraMessage(time, message))
        elif isinstance(message, CommandAck | StatusText):
            self._utterances.append(EventMessage(time, message))

    def log(self, report: TlogReport) -> Log:
        """Return the log, with the reader's report on the file."""
        received = {sender: growing.stream() for sender, growing in sorted(self._received.items())}
        speeds = ned_to_enu(np.array(self._speeds, dtype=np.float64).reshape(-1, 3))
        moments = _whole(self._moments)
        said = tuple(self._utterances)
        return Log(
            self._owner,
            self._begin,
            self._end,
            self._sent.stream(),
            received,
            moments,
            speeds,
            said,
            report,
            tuple(self._seen),
        )
