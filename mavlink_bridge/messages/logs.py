"""Messages that list, download and erase the logs of a vehicle. All values are as in the message."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.errors import EncodeError
from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import Fields
from mavlink_bridge.messages.source import Source

LOG_DATA_LENGTH = 90


@message("LOG_REQUEST_LIST")
class LogRequestList(NamedTuple):
    """LOG_REQUEST_LIST (117): logs with the ids ``first`` to ``last`` (0xFFFF: to the last one)."""

    source: Source
    first: int
    last: int
    target_system: int
    target_component: int


@message("LOG_ENTRY")
class LogEntry(NamedTuple):
    """LOG_ENTRY (118): ``time`` of the log's end (Unix, s; 0 if unknown), ``size`` in bytes.

    ``total``: number of logs. Without logs, ``total``, ``id`` and ``last`` are 0.
    """

    source: Source
    time: int
    size: int
    id: int
    total: int
    last: int


@message("LOG_REQUEST_DATA")
class LogRequestData(NamedTuple):
    """LOG_REQUEST_DATA (119): ``length`` bytes from ``offset`` of the log ``id``."""

    source: Source
    offset: int
    length: int
    id: int
    target_system: int
    target_component: int


@message("LOG_DATA")
class LogData(NamedTuple):
    """LOG_DATA (120): up to 90 bytes from ``offset`` of the log ``id``; fewer mean the log's end."""

    source: Source
    offset: int
    id: int
    data: bytes

    @staticmethod
    def decode(source: Source, fields: Fields) -> LogData | None:
        offset, number, count, data = fields
        return LogData(source, offset, number, data[:count]) if count <= LOG_DATA_LENGTH else None

    def encode(self) -> Fields:
        if len(self.data) > LOG_DATA_LENGTH:
            raise EncodeError(f"LOG_DATA: {len(self.data)} bytes are more than {LOG_DATA_LENGTH}")
        return self.offset, self.id, len(self.data), self.data


@message("LOG_ERASE")
class LogErase(NamedTuple):
    """LOG_ERASE (121): erase all logs."""

    source: Source
    target_system: int
    target_component: int


@message("LOG_REQUEST_END")
class LogRequestEnd(NamedTuple):
    """LOG_REQUEST_END (122): end the download."""

    source: Source
    target_system: int
    target_component: int
