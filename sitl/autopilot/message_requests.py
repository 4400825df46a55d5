"""Commands and messages that request other messages."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import LONGEST_INTERVAL, Message, MessageInterval, RequestDataStream, Source
from sitl.autopilot.command_protocol import Handler, Order
from sitl.autopilot.firmware import CommandRefusal, Firmware
from sitl.autopilot.firmware.mode_list import available_modes
from sitl.telemetry.schedule import Telemetry
from sitl.telemetry.streams import members

_LAST_ID: Final = 0xFFFF
_SLOWEST_HEARTBEAT_US: Final = 1_000_000


class Requests:
    """Handler of message requests.

    It executes SET_MESSAGE_INTERVAL (511), GET_MESSAGE_INTERVAL (510), REQUEST_MESSAGE (512), the older
    GET_HOME_POSITION (410) and REQUEST_AUTOPILOT_CAPABILITIES (520), and REQUEST_DATA_STREAM (66).
    """

    def __init__(
        self, source: Source, flavour: Firmware, telemetry: Telemetry, outbox: list[Message]
    ) -> None:
        self._source = source
        self._flavour = flavour
        self._telemetry = telemetry
        self._outbox = outbox

    @property
    def commands(self) -> dict[int, Handler]:
        """Handlers by MAV_CMD."""
        return {
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request,
            mavlink.MAV_CMD_GET_HOME_POSITION: self._always(mavlink.MAVLINK_MSG_ID_HOME_POSITION),
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._always(
                mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
            ),
        }

    def stream(self, message: RequestDataStream, now: int) -> None:
        """Handle REQUEST_DATA_STREAM (66), ArduPilot only: set the rate of a whole group."""
        if self._flavour.groups_streams:
            self.set_rate(message.stream, message.rate if message.start else 0, now)

    def set_rate(self, stream: int, rate: float | None, now: int) -> None:
        """Send all messages of a MAV_DATA_STREAM at ``rate`` (Hz), limited to the firmware's highest rate.

        0 stops them, None restores the default rate.
        """
        if rate is None:
            interval = 0
        else:
            interval = max(self._flavour.shortest_interval, round(1e6 / rate)) if rate > 0 else -1
        for message_id in members(stream):
            self._telemetry.set_interval(message_id, interval, now)

    def _set_interval(self, order: Order) -> CommandRefusal | None:
        message_id, interval = order.params[:2]
        if not (math.isfinite(message_id) and math.isfinite(interval)):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Interval refused: not a number")
        if 0.0 < interval < self._flavour.shortest_interval:
            return CommandRefusal(
                mavlink.MAV_RESULT_FAILED, f"Interval refused: {interval:.0f} us is too short"
            )
        if self._telemetry.silent(int(message_id)):
            return CommandRefusal(
                mavlink.MAV_RESULT_DENIED, f"Interval refused: no data for {message_id:.0f}"
            )
        if message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and not 0.0 <= interval <= _SLOWEST_HEARTBEAT_US:
            # All clients hear the same HEARTBEAT, and take the vehicle for lost without it.
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Interval refused: HEARTBEAT stays on")
        wanted = min(round(interval), LONGEST_INTERVAL)
        if not self._telemetry.set_interval(int(message_id), wanted, order.now):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, f"Interval refused: no message {message_id:.0f}")
        return None

    def _get_interval(self, order: Order) -> CommandRefusal | None:
        message_id = order.params[0]
        if not 0 <= message_id <= _LAST_ID:
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Interval refused: no such number")
        interval = self._telemetry.interval(int(message_id))
        self._outbox.append(MessageInterval(self._source, interval, int(message_id)))
        return None

    def _request(self, order: Order) -> CommandRefusal | None:
        message_id, which = order.params[:2]
        if message_id == mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES:
            return self._list_modes(which)
        if math.isfinite(message_id) and self._telemetry.silent(int(message_id)):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, f"Request refused: no data for {message_id:.0f}")
        if math.isfinite(message_id) and self._telemetry.request(int(message_id)):
            return None
        return CommandRefusal(mavlink.MAV_RESULT_UNSUPPORTED, f"Request refused: no message {message_id:.0f}")

    def _list_modes(self, which: float) -> CommandRefusal | None:
        """Send AVAILABLE_MODES (435) of the index ``which``, or of all modes for 0."""
        modes = available_modes(self._source, self._flavour)
        if which not in range(len(modes) + 1):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, f"Request refused: no mode {which:.0f}")
        self._outbox += modes if which == 0 else [modes[int(which) - 1]]
        return None

    def _always(self, message_id: int) -> Callable[[Order], CommandRefusal | None]:
        def obey(_order: Order) -> CommandRefusal | None:
            self._telemetry.request(message_id)
            return None

        return obey
