"""Command protocol: COMMAND_LONG (76) or COMMAND_INT (75) in, a commander's method, COMMAND_ACK (77) out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import CommandInt, CommandLong
from sitl.autopilot.commander import Commander
from sitl.autopilot.firmware import CommandRefusal, Firmware, Mode
from sitl.values.home import ABOVE_HOME, ABOVE_SEA, NOWHERE

# Value of parameter 2 of COMPONENT_ARM_DISARM (400) that forces arming or disarming.
_FORCE_CODE: Final = 21196.0


class Order(NamedTuple):
    """One command, independent of the message that carried it.

    ``relative``: whether its altitude counts from home (True), from mean sea level (False), or is unspecified
    (None). ``integer``: it came as COMMAND_INT, with latitude and longitude in degE7.
    """

    params: tuple[float, ...]
    relative: bool | None
    now: int
    integer: bool = False

    @property
    def place(self) -> tuple[float, float, float]:
        """Parameters 5 to 7 as latitude and longitude (degrees) and altitude (m)."""
        x, y, z = self.params[4:7]
        return (x / 1e7, y / 1e7, z) if self.integer else (x, y, z)

    @property
    def nowhere(self) -> bool:
        """Whether an integer latitude or longitude means "unchanged"."""
        return self.integer and NOWHERE in self.params[4:6]


class Verdict(NamedTuple):
    """Result of a command: a MAV_RESULT for COMMAND_ACK, and the reason for a refusal for STATUSTEXT."""

    result: int
    reason: str


Handler = Callable[[Order], CommandRefusal | None]
"""Executes one command, or returns the reason for refusing it."""


class Orders:
    """Executor of commands. A repeated request to arm, to disarm or for a mode has no further effect."""

    def __init__(self, commander: Commander, flavour: Firmware, more: Mapping[int, Handler]) -> None:
        """``more`` maps all other supported MAV_CMDs to their handlers."""
        self._commander = commander
        self._flavour = flavour
        self._handlers: dict[int, Handler] = {
            mavlink.MAV_CMD_NAV_LAND: self._land,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
            **more,
        }

    def obey(self, message: CommandLong | CommandInt, now: int) -> Verdict:
        """Execute a command addressed to this vehicle that arrived at ``now`` (µs)."""
        handler = self._handlers.get(message.command)
        if handler is None:
            return Verdict(mavlink.MAV_RESULT_UNSUPPORTED, f"Command {message.command} is not supported")
        refusal = handler(_order(message, now))
        return Verdict(mavlink.MAV_RESULT_ACCEPTED, "") if refusal is None else Verdict(*refusal)

    def set_mode(self, custom_mode: int, base_mode: int, now: int) -> Verdict:
        """Execute SET_MODE (11), which has the mode in one number, at ``now`` (µs)."""
        main, sub = self._flavour.split(custom_mode)
        refusal = self._set_mode(Order((base_mode, main, sub), None, now))
        return Verdict(mavlink.MAV_RESULT_ACCEPTED, "") if refusal is None else Verdict(*refusal)

    def _arm(self, order: Order) -> CommandRefusal | None:
        wanted, code = order.params[:2]
        if wanted == 1.0:
            return self._commander.arm(order.now, forced=code == _FORCE_CODE)
        if wanted == 0.0:
            return self._commander.disarm(forced=code == _FORCE_CODE)
        return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Arming: parameter 1 must be 0 or 1")

    def _take_off(self, order: Order) -> CommandRefusal | None:
        return self._commander.take_off(order.params[6], order.relative, order.now)

    def _land(self, order: Order) -> CommandRefusal | None:
        return self._commander.enter(Mode.LAND, order.now)

    def _set_mode(self, order: Order) -> CommandRefusal | None:
        base, main, sub = order.params[:3]
        custom = math.isfinite(base) and int(base) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if not (custom and math.isfinite(main)):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Mode refused: only custom modes are known")
        sub = sub if math.isfinite(sub) else 0.0
        mode = self._flavour.requested(int(main), int(sub))
        if mode is None:
            return CommandRefusal(
                mavlink.MAV_RESULT_DENIED, f"Mode refused: {main:.0f}, {sub:.0f} is not known"
            )
        if mode is Mode.TAKEOFF:
            return self._commander.take_off(math.nan, None, order.now)
        return self._commander.enter(mode, order.now)


def _order(message: CommandLong | CommandInt, now: int) -> Order:
    if isinstance(message, CommandLong):
        return Order(message.params, None, now)
    relative = True if message.frame in ABOVE_HOME else False if message.frame in ABOVE_SEA else None
    return Order((*message.params, message.x, message.y, message.z), relative, now, integer=True)
