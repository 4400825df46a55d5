"""Commands: COMMAND_LONG (76) or COMMAND_INT (75) in, a verb of the commander, COMMAND_ACK (77) out."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

from mavlink_bridge.messages import CommandInt, CommandLong
from sitl.commander import Commander
from sitl.flavours import ACCEPTED, CUSTOM, DENIED, FAILED, UNSUPPORTED, Denial, Flavour, Mode
from sitl.telemetry import Telemetry

# MAV_CMD
LAND: Final = 21
TAKEOFF: Final = 22
SET_MODE: Final = 176
ARM: Final = 400
SET_INTERVAL: Final = 511
REQUEST: Final = 512

_FORCED: Final = 21196.0
# MAV_FRAME
_GLOBAL: Final = (0, 5)
_RELATIVE: Final = (3, 6)


class Order(NamedTuple):
    """A command, whichever message brought it. ``relative``: its altitude counts from home (True), from mean
    sea level (False), unsaid (None)."""

    params: tuple[float, ...]
    relative: bool | None
    now: int


class Verdict(NamedTuple):
    """What becomes of a command: a MAV_RESULT for COMMAND_ACK, and for STATUSTEXT why not."""

    result: int
    reason: str


class Orders:
    """Obeys commands. A retried command finds that what it asks is already so, and changes nothing."""

    def __init__(self, commander: Commander, flavour: Flavour, telemetry: Telemetry) -> None:
        self._commander = commander
        self._flavour = flavour
        self._telemetry = telemetry
        self._handlers: dict[int, Callable[[Order], Denial | None]] = {
            LAND: self._land,
            TAKEOFF: self._take_off,
            SET_MODE: self._set_mode,
            ARM: self._arm,
            SET_INTERVAL: self._set_interval,
            REQUEST: self._request,
        }

    def obey(self, message: CommandLong | CommandInt, now: int) -> Verdict:
        """Act on a command addressed to this vehicle that arrived at ``now`` (µs)."""
        handler = self._handlers.get(message.command)
        if handler is None:
            return Verdict(UNSUPPORTED, f"Command {message.command} is not supported")
        denial = handler(_order(message, now))
        return Verdict(ACCEPTED, "") if denial is None else Verdict(*denial)

    def _arm(self, order: Order) -> Denial | None:
        wanted, code = order.params[:2]
        if wanted == 1.0:
            return self._commander.arm(order.now, forced=code == _FORCED)
        if wanted == 0.0:
            return self._commander.disarm(forced=code == _FORCED)
        return Denial(DENIED, "Arming: parameter 1 must be 0 or 1")

    def _take_off(self, order: Order) -> Denial | None:
        return self._commander.take_off(order.params[6], order.relative, order.now)

    def _land(self, order: Order) -> Denial | None:
        return self._commander.enter(Mode.LAND, order.now)

    def _set_mode(self, order: Order) -> Denial | None:
        base, main, sub = order.params[:3]
        if not (math.isfinite(base) and int(base) & CUSTOM and math.isfinite(main)):
            return Denial(DENIED, "Mode refused: only custom modes are known")
        sub = sub if math.isfinite(sub) else 0.0
        mode = self._flavour.requested(int(main), int(sub))
        if mode is None:
            return Denial(DENIED, f"Mode refused: {main:.0f}, {sub:.0f} is not known")
        if mode is Mode.TAKEOFF:
            return self._commander.take_off(math.nan, None, order.now)
        return self._commander.enter(mode, order.now)

    def _set_interval(self, order: Order) -> Denial | None:
        message_id, interval = order.params[:2]
        if not (math.isfinite(message_id) and math.isfinite(interval)):
            return Denial(DENIED, "Interval refused: not a number")
        if 0.0 < interval < self._flavour.shortest_interval:
            return Denial(FAILED, f"Interval refused: {interval:.0f} us is too short")
        if not self._telemetry.set_interval(int(message_id), round(interval), order.now):
            return Denial(DENIED, f"Interval refused: no message {message_id:.0f}")
        return None

    def _request(self, order: Order) -> Denial | None:
        message_id = order.params[0]
        if math.isfinite(message_id) and self._telemetry.request(int(message_id)):
            return None
        return Denial(UNSUPPORTED, f"Request refused: no message {message_id:.0f}")


def _order(message: CommandLong | CommandInt, now: int) -> Order:
    if isinstance(message, CommandLong):
        return Order(message.params, None, now)
    relative = True if message.frame in _RELATIVE else False if message.frame in _GLOBAL else None
    return Order((*message.params, message.x, message.y, message.z), relative, now)
