"""Asking why the pre-arm check fails, and waiting for the answer.

ArduPilot answers MAV_CMD_RUN_PREARM_CHECKS (401) with a text for each reason, and says them again every 30 s.
PX4 answers with EVENT messages, and with texts where it hears a ground station.
"""

from __future__ import annotations

from typing import Final

from mavlink_bridge.messages import CommandLong, Message, Source, SysStatus
from outrider.doctor.speaker import Speaker

RUN_CHECKS: Final = 401
_PX4: Final = 12
_LISTEN: Final = 35_000_000
"""µs: ArduPilot's own texts come every 30 s, whoever asks."""
_LISTEN_PX4: Final = 6_000_000
"""µs: PX4 reports when it is asked, and does not repeat it."""
_SETTLED: Final = 2_000_000
"""µs after a reason: others follow at once."""
_AGAIN: Final = 5_000_000
_TRIES: Final = 3


class Objections:
    """Of one vehicle: when to ask, and for how long to listen. It asks only a vehicle that is disarmed and
    whose check fails: running the checks changes nothing of it."""

    def __init__(self) -> None:
        self._first: int | None = None
        self._last = self._times = 0

    def due(self, vehicle: Speaker, me: Source, now: int) -> list[Message]:
        """What to send at ``now`` (µs)."""
        if not self._open(vehicle) or self._known(vehicle) or self._times >= _TRIES:
            return []
        if self._first is not None and now - self._last < _AGAIN:
            return []
        self._first = now if self._first is None else self._first
        self._last = now
        self._times += 1
        system, component = vehicle.source
        return [CommandLong(me, system, component, RUN_CHECKS, 0, (0.0,) * 7)]

    def left(self, vehicle: Speaker, now: int) -> int:
        """For how long (µs) to listen on at most; 0 when there is nothing to wait for."""
        if not self._open(vehicle):
            return 0
        if self._known(vehicle):
            return max(max(vehicle.objected_at, self._last) + _SETTLED - now, 0)
        listen = _LISTEN_PX4 if _is_px4(vehicle) else _LISTEN
        return listen if self._first is None else max(self._first + listen - now, 0)

    def _open(self, vehicle: Speaker) -> bool:
        fails = vehicle.latest(SysStatus) is not None and not vehicle.vehicle.healthy
        return fails and not vehicle.vehicle.armed and (vehicle.tells_checks or _is_px4(vehicle))

    def _known(self, vehicle: Speaker) -> bool:
        """Whether it was asked and has named a reason, be it before."""
        return bool(vehicle.objections) and self._first is not None


def _is_px4(vehicle: Speaker) -> bool:
    beat = vehicle.vehicle.heartbeat
    return beat is not None and beat.autopilot == _PX4
