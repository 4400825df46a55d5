"""Mission messages and commands, and their handlers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionCurrent,
    MissionItem,
    MissionItemFloat,
    MissionItemReached,
    MissionRequest,
    MissionRequestFloat,
    MissionRequestList,
    MissionSetCurrent,
    MissionWritePartialList,
    Source,
)
from sitl.autopilot.command_protocol import Handler, Order
from sitl.autopilot.commander import Commander
from sitl.autopilot.firmware import CommandRefusal, Mode
from sitl.autopilot.missions.items import Item, Type
from sitl.autopilot.missions.itinerary import Itinerary, Phase
from sitl.autopilot.missions.plans import Plans
from sitl.autopilot.missions.transfer import Transfer
from sitl.telemetry.schedule import Telemetry
from sitl.telemetry.status_text import StatusReporter

# MISSION_CURRENT.mission_mode
_IN_MODE, _SUSPENDED = 1, 2


class MissionService:
    """Mission ``handlers`` and ``commands``, and MISSION_CURRENT (42) and MISSION_ITEM_REACHED (46)."""

    def __init__(
        self,
        source: Source,
        plans: Plans,
        itinerary: Itinerary,
        commander: Commander,
        telemetry: Telemetry,
        outbox: list[Message],
        status_text: StatusReporter,
        *,
        asks_int: bool,
        home: Callable[[], Item] | None = None,
        guided: Callable[[Item, int], bool] | None = None,
    ) -> None:
        """Set the partners; ``home`` and ``guided`` as in ``Transfer``."""
        self._source = source
        self._plans = plans
        self._itinerary = itinerary
        self._commander = commander
        self._telemetry = telemetry
        self._outbox = outbox
        self._status_text = status_text
        self.transfer = Transfer(
            source, plans, outbox, status_text, asks_int=asks_int, home=home, guided=guided
        )
        plans.changed = itinerary.replaced
        transfer = self.transfer
        self.handlers: dict[type[Any], Callable[[Any, int], None]] = {
            MissionCount: transfer.count,
            MissionItem: transfer.item,
            MissionItemFloat: transfer.item,
            MissionAck: transfer.acknowledged,
            MissionClearAll: transfer.clear,
            MissionRequestList: transfer.list,
            MissionRequest: self._request,
            MissionRequestFloat: self._request,
            MissionWritePartialList: transfer.write_partial,
            MissionSetCurrent: self._set_current,
        }
        self.commands: dict[int, Handler] = {
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self._return,
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: self._order_current,
            mavlink.MAV_CMD_MISSION_START: self._start,
        }

    def tell(self) -> None:
        """Report the items reached since the last call."""
        reached = self._itinerary.reached
        if reached:
            self._outbox += [MissionItemReached(self._source, seq) for seq in reached]
            reached.clear()
            self._telemetry.request(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)

    def current(self) -> MissionCurrent:
        """Return MISSION_CURRENT (42)."""
        itinerary, plans = self._itinerary, self._plans
        flying = self._commander.mode is Mode.MISSION
        if not itinerary.total:
            state = mavlink.MISSION_STATE_NO_MISSION
        elif itinerary.phase is Phase.DONE:
            state = mavlink.MISSION_STATE_COMPLETE
        elif flying and self._commander.armed:
            state = mavlink.MISSION_STATE_ACTIVE
        else:
            state = mavlink.MISSION_STATE_PAUSED if itinerary.begun else mavlink.MISSION_STATE_NOT_STARTED
        ids = (plans.identity(of) for of in Type)
        mode = _IN_MODE if flying else _SUSPENDED
        return MissionCurrent(self._source, itinerary.current, itinerary.total, state, mode, *ids)

    def _request(self, message: MissionRequest | MissionRequestFloat, _now: int) -> None:
        self.transfer.request(message, self._itinerary.current)

    def _set_current(self, message: MissionSetCurrent, now: int) -> None:
        if not self._itinerary.select(message.seq):
            self._status_text.complain(f"No mission item {message.seq}", now)
        self._telemetry.request(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)

    def _order_current(self, order: Order) -> CommandRefusal | None:
        """Execute DO_SET_MISSION_CURRENT.

        If parameter 2 is 1, the mission returns to its first item. Parameter 1 is the item to continue with;
        −1 selects none. A refused command changes nothing.
        """
        seq, anew = order.params[:2]
        if seq != -1.0 and not (math.isfinite(seq) and self._itinerary.has(int(seq))):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, f"No mission item {seq:.0f}")
        if anew == 1.0:
            self._itinerary.rewind()
        if seq != -1.0:
            self._itinerary.select(int(seq))
        self._telemetry.request(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)
        return None

    def _start(self, order: Order) -> CommandRefusal | None:
        return self._commander.start_mission(order.now)

    def _return(self, order: Order) -> CommandRefusal | None:
        return self._commander.enter(Mode.RETURN, order.now)
