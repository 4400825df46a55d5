"""Requests for the reasons of a failing pre-arm check.

ArduPilot answers MAV_CMD_RUN_PREARM_CHECKS (401) with one text per reason, and repeats them every 30 s. PX4
answers with EVENT messages, and with texts on links where it receives a ground station's heartbeat.
"""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import CommandLong, Message, Source, SysStatus
from outrider.doctor.sender_record import SenderRecord

_WAIT_ARDUPILOT_US: Final = 35_000_000
"""µs; ArduPilot sends its texts every 30 s even without a request."""
_WAIT_PX4_US: Final = 6_000_000
"""µs; PX4 reports its reasons on request and does not repeat them."""
_SETTLING_US: Final = 2_000_000
"""Time to wait after a reason (µs): others follow at once."""
_REPEAT_INTERVAL_US: Final = 5_000_000
_MAX_REQUESTS: Final = 3


class Objections:
    """Timing of the requests to one vehicle, and of waiting for the answers.

    Requests go only to a disarmed vehicle whose check fails: running the checks changes nothing there.
    """

    def __init__(self) -> None:
        self._first: int | None = None
        self._last = self._times = 0

    def due(self, vehicle: SenderRecord, me: Source, now: int) -> list[Message]:
        """Return the messages to send at ``now`` (µs)."""
        if not self._open(vehicle) or self._known(vehicle) or self._times >= _MAX_REQUESTS:
            return []
        if self._first is not None and now - self._last < _REPEAT_INTERVAL_US:
            return []
        self._first = now if self._first is None else self._first
        self._last = now
        self._times += 1
        system, component = vehicle.source
        return [CommandLong(me, system, component, mavlink.MAV_CMD_RUN_PREARM_CHECKS, 0, (0.0,) * 7)]

    def left(self, vehicle: SenderRecord, now: int) -> int:
        """Return the longest time (µs) left to wait; 0 when there is nothing to wait for."""
        if not self._open(vehicle):
            return 0
        if self._known(vehicle):
            return max(max(vehicle.objected_at, self._last) + _SETTLING_US - now, 0)
        listen = _WAIT_PX4_US if vehicle.is_px4 else _WAIT_ARDUPILOT_US
        return listen if self._first is None else max(self._first + listen - now, 0)

    def _open(self, vehicle: SenderRecord) -> bool:
        fails = vehicle.latest(SysStatus) is not None and not vehicle.vehicle.healthy
        return fails and not vehicle.vehicle.armed and (vehicle.tells_checks or vehicle.is_px4)

    def _known(self, vehicle: SenderRecord) -> bool:
        """Return whether the vehicle was asked and has named a reason, possibly before the request."""
        return bool(vehicle.objections) and self._first is not None
