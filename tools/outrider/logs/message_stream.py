"""A tlog as a stream of messages, with a count of its unreadable parts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.errors import LogError
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.framing import Flaw, frame_at
from outrider.logs.dialect import Kind, kind

LATEST: Final = (1 << 63) // 1000 - 1
"""µs, in the year 2262: later stamps do not fit the formats that count nanoseconds, and are damage."""
_MESSAGES_PER_REPORT: Final = 2048
"""Number of messages between two reports of progress."""

Watch = Callable[[str, float], None]


class LogMessage(NamedTuple):
    """A message of a log.

    ``time`` Unix µs, its ``link`` (0…3), its sender, and its complete payload.
    """

    time: int
    link: int
    system: int
    component: int
    kind: Kind
    payload: bytes


class Loss(NamedTuple):
    """Parts that a pass left out: ``damaged`` records, and ``unknown`` ones that the dialect lacks."""

    damaged: int
    unknown: int


class Log:
    """The tlog at ``path``.

    ``owner``: the vehicle whose companion recorded it; None for any other log.
    """

    def __init__(self, path: Path, owner: int | None) -> None:
        self.path, self.owner = path, owner
        self.done = 0
        self.loss = Loss(0, 0)

    @property
    def size(self) -> int:
        """Size of the file in bytes."""
        return self.path.stat().st_size

    def check(self) -> None:
        """Raise LogError if the log is missing, unreadable or without a MAVLink frame."""
        read_tlog(self.path)

    def __iter__(self) -> Iterator[LogMessage]:
        """Yield every message once, in the order of the file, without SETUP_SIGNING, which holds a key.

        Afterwards ``loss`` holds what else was left out.
        """
        reader = read_tlog(self.path)
        self.done = late = unknown = 0
        for record in reader:
            self.done += 8 + len(record.frame)
            if record.time > LATEST:
                late += 1
                continue
            frame = frame_at(record.frame, 0)
            if isinstance(frame, Flaw):
                raise LogError(f"{self.path}: the reader handed out what is no frame")
            if frame.message_id == mavlink.MAVLINK_MSG_ID_SETUP_SIGNING:
                continue
            if frame.message_id not in mavlink.mavlink_map:
                # The bridge has it, but the dialect lacks its fields.
                unknown += 1
                continue
            known = kind(frame.message_id)
            yield LogMessage(
                record.time, record.link, frame.system, frame.component, known, known.whole(frame.payload)
            )
        report = reader.report
        self.loss = Loss(report.bad + report.truncated + late, report.unknown + unknown)


def watched(
    logs: list[Log], watch: Watch, share: tuple[float, float] = (0.0, 1.0)
) -> list[Iterator[LogMessage]]:
    """Return the messages of each log, with progress reports.

    ``watch`` is called with the name of the log that is being read, and with the share of all logs that has
    been read, scaled to the range ``share``.
    """
    total = max(sum(log.size for log in logs), 1)
    low, high = share

    def of(log: Log) -> Iterator[LogMessage]:
        for number, spoken in enumerate(log):
            if number % _MESSAGES_PER_REPORT == 0:
                done = min(sum(one.done for one in logs) / total, 1.0)
                watch(log.path.name, low + (high - low) * done)
            yield spoken

    return [of(log) for log in logs]


def total_loss(logs: list[Log]) -> Loss:
    """Return the loss of all logs together."""
    return Loss(sum(log.loss.damaged for log in logs), sum(log.loss.unknown for log in logs))
