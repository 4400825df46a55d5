"""Recorder of flights: one log from arming to disarming, at 10 Hz, in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from sitl.autopilot.logs.dataflash import DataFlash
from sitl.autopilot.logs.moment import LoggedParameter, Moment
from sitl.autopilot.logs.ulog import Ulog

_PERIOD_US: Final = 100_000
# Eight logs of at most 4 MiB: some seven hours of flight.
_MOST_LOGS, _MOST_BYTES = 8, 4 << 20


class Log:
    """One log. ``ended_utc``: Unix time (s) of its last record, 0 if unknown."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.data = bytearray()
        self.ended_utc = 0


class Recorder:
    """Recorder of one vehicle. ``logs`` is in order of time; the oldest are dropped after eight."""

    def __init__(
        self,
        encoder: type[DataFlash] | type[Ulog],
        moment: Callable[[int], Moment],
        parameters: Callable[[], Iterable[LoggedParameter]],
        epoch: Callable[[], int],
    ) -> None:
        """Set what is recorded.

        ``moment`` returns the moment of a time (µs), ``parameters`` all parameters,
        ``epoch`` the Unix time of the boot (µs), 0 if unknown.
        """
        self._new, self._moment, self._parameters, self._epoch = encoder, moment, parameters, epoch
        self._encoder = encoder()
        self.logs: list[Log] = []
        self._number = 0
        self._open: Log | None = None
        self._mode = -1
        self._due = 0

    @property
    def extension(self) -> str:
        """Extension of the files."""
        return self._new.extension

    def watch(self, now: int, *, armed: bool, custom_mode: int) -> None:
        """Record what is due at ``now`` (µs since boot, by the vehicle's clock)."""
        if armed and self._open is None:
            self._begin(now)
        log = self._open
        if log is None:
            return
        room = len(log.data) < _MOST_BYTES
        if custom_mode != self._mode and room:
            self._mode = custom_mode
            log.data += self._encoder.mode(now, custom_mode)
        if not armed:
            log.data += self._encoder.armed(now, armed=False)
            self._open = None
        elif now >= self._due and room:
            self._due = now + _PERIOD_US
            log.data += self._encoder.moment(self._moment(now))
        epoch = self._epoch()
        log.ended_utc = (epoch + now) // 1_000_000 if epoch else 0

    def erase(self) -> None:
        """Erase all logs but the one that is being recorded."""
        self.logs = [log for log in self.logs if log is self._open]

    def _begin(self, now: int) -> None:
        self._encoder = self._new()
        self._number += 1
        log = Log(self._number)
        log.data += self._encoder.head(now, self._parameters()) + self._encoder.armed(now, armed=True)
        self._open, self._mode, self._due = log, -1, now
        self.logs = [*self.logs, log][-_MOST_LOGS:]
