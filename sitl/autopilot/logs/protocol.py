"""Log protocol: LOG_REQUEST_LIST (117), LOG_REQUEST_DATA (119), LOG_ERASE (121), LOG_REQUEST_END (122).

ArduPilot numbers logs from 1 and sends none while armed; PX4 numbers them from 0.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from mavlink_bridge.messages import (
    LOG_DATA_LENGTH,
    LogData,
    LogEntry,
    LogErase,
    LogRequestData,
    LogRequestEnd,
    LogRequestList,
    Message,
    Source,
)
from sitl.autopilot.logs.recorder import Log, Recorder
from sitl.telemetry.status_text import StatusReporter

_BURST, _BURST_INTERVAL_US = 10, 10_000
_MOST_DOWNLOADS: Final = 16
_NEVER: Final = 1 << 62


class LogProtocol:
    """Server of the logs of ``recorder``. ``next_due`` (µs): no ``work`` is due before it."""

    def __init__(
        self,
        source: Source,
        outbox: list[Message],
        recorder: Recorder,
        reporter: StatusReporter,
        armed: Callable[[], bool],
        *,
        first: int,
        refuses_armed: bool,
    ) -> None:
        """``first``: id of the oldest log; ``refuses_armed``: nothing is sent while ``armed``."""
        self._source, self._outbox, self._recorder = source, outbox, recorder
        self._reporter, self._armed = reporter, armed
        self._first, self._refuses_armed = first, refuses_armed
        self._downloads: dict[Source, tuple[bytearray, int, int, int]] = {}
        self.next_due = _NEVER
        self.handlers: dict[type[Any], Callable[[Any, int], None]] = {
            LogRequestList: self._list,
            LogRequestData: self._begin,
            LogErase: self._erase,
            LogRequestEnd: self._end,
        }

    def work(self, now: int) -> None:
        """Send the next packets of each download."""
        going = self._downloads
        self._downloads = {}
        for client, (contents, number, offset, end) in going.items():
            for _ in range(_BURST):
                data = bytes(contents[offset : min(offset + LOG_DATA_LENGTH, end)])
                self._outbox.append(LogData(self._source, offset, number, data))
                offset += len(data)
                if len(data) < LOG_DATA_LENGTH or offset >= end:
                    break
            else:
                self._downloads[client] = contents, number, offset, end
        self.next_due = now + _BURST_INTERVAL_US if self._downloads else _NEVER

    def _list(self, message: LogRequestList, now: int) -> None:
        if self._refused(now):
            return
        logs = self._recorder.logs
        last = self._first + len(logs) - 1
        if not logs:
            self._outbox.append(LogEntry(self._source, 0, 0, 0, 0, 0))
        for number, log in enumerate(logs, self._first):
            if message.first <= number <= message.last:
                size = len(log.data)
                self._outbox.append(LogEntry(self._source, log.ended_utc, size, number, len(logs), last))

    def _begin(self, message: LogRequestData, now: int) -> None:
        log = self._log(message.id)
        if self._refused(now):
            return
        if log is None:
            self._reporter.complain(f"No log {message.id}", now)
            return
        if message.source not in self._downloads and len(self._downloads) >= _MOST_DOWNLOADS:
            self._reporter.complain("Log download in progress", now)
            return
        # Records are only appended: what is there now stays, and a request copies nothing.
        end = min(message.offset + message.length, len(log.data))
        self._downloads[message.source] = log.data, message.id, min(message.offset, 0xFFFFFFFF), end
        self.next_due = min(self.next_due, now)

    def _erase(self, _message: LogErase, now: int) -> None:
        if not self._refused(now):
            self._downloads.clear()
            self._recorder.erase()

    def _end(self, message: LogRequestEnd, _now: int) -> None:
        self._downloads.pop(message.source, None)

    def _log(self, number: int) -> Log | None:
        index = number - self._first
        return self._recorder.logs[index] if 0 <= index < len(self._recorder.logs) else None

    def _refused(self, now: int) -> bool:
        refused = self._refuses_armed and self._armed()
        if refused:
            self._reporter.complain("Disarm for log download", now)
        return refused
