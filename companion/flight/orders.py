"""Commands of an operator to a companion.

NAV_TAKEOFF is the go, DO_REPOSITION sets the goal, NAV_LOITER_UNLIM holds the position, NAV_RETURN_TO_LAUNCH
returns and lands, NAV_LAND lands.
"""

from __future__ import annotations

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.state_machine import Pilot
from companion.goals.goals import Goals
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandAck, CommandInt, CommandLong, Message, Source

_GLOBAL = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
_MAX_ALTITUDE = 1e5
"""m, bound on the magnitude of altitudes; the comparison with it also rejects NaN."""
_EDGE_M = 0.1
"""Distance outside the box, on each axis, up to which a goal counts as one on its edge.

Positions in units of 1e-7 degrees have steps of 11 mm, and with two models of the Earth distances from the
fleet origin may differ by 0.07 %.
"""


class Orders:
    """Executes commands to the companion ``own`` and answers each with a COMMAND_ACK.

    Commands to other addressees are not answered.
    """

    def __init__(
        self, config: CompanionConfig, own: Source, fleet: FleetFrame, pilot: Pilot, goals: Goals
    ) -> None:
        self._config = config
        self._own = own
        self._fleet = fleet
        self._pilot = pilot
        self._goals = goals

    def obey(self, message: Message) -> list[Message]:
        """Execute ``message`` if it is a command to ``own``; return the COMMAND_ACK, or an empty list."""
        if not isinstance(message, CommandInt | CommandLong):
            return []
        if (message.target_system, message.target_component) != self._own:
            return []
        taken = self._taken(message)
        if taken is None:
            result = mavlink.MAV_RESULT_UNSUPPORTED
        else:
            result = mavlink.MAV_RESULT_ACCEPTED if taken else mavlink.MAV_RESULT_DENIED
        return [CommandAck(self._own, message.command, result, 0, 0, *message.source)]

    def _taken(self, order: CommandInt | CommandLong) -> bool | None:
        """Execute the command and return whether it is accepted; None for an unknown one."""
        pilot = self._pilot
        if isinstance(order, CommandInt):
            return self._reposition(order) if order.command == mavlink.MAV_CMD_DO_REPOSITION else None
        if order.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            return pilot.go(order.params[6])
        plain = {
            mavlink.MAV_CMD_NAV_LAND: pilot.land,
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: pilot.hold,
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: pilot.come_back,
        }
        obey = plain.get(order.command)
        return None if obey is None else obey()

    def _reposition(self, order: CommandInt) -> bool:
        """Set the goal to a global position, altitude above mean sea level; return whether it is accepted.

        The order is refused if its frame is not one of ``_GLOBAL``, if the position is invalid or outside the
        box of ``limits`` by more than ``_EDGE_M``, and if the task is not "goto".
        """
        latitude, longitude = order.x * 1e-7, order.y * 1e-7
        if order.frame not in _GLOBAL or abs(latitude) > 90.0 or abs(longitude) > 180.0:
            return False
        if not abs(order.z) < _MAX_ALTITUDE:
            return False
        goal = self._fleet.to_enu(latitude, longitude, order.z)
        limits = self._config.limits
        inside = np.clip(goal, limits.box_min, limits.box_max)
        if self._config.task != "goto" or float(np.abs(goal - inside).max()) > _EDGE_M:
            return False
        self._goals.goal = inside
        return True
