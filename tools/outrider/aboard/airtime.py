"""What a swarm says over its link each second, and how many vehicles a line has room for."""

from __future__ import annotations

from typing import Final

from companion.config import CompanionConfig
from companion.sharing import ACTIVE, AUTOPILOT_INVALID, ONBOARD_CONTROLLER
from mavlink_bridge.codec import Codec
from mavlink_bridge.links.endpoints import Endpoint, Serial
from mavlink_bridge.messages import GlobalPosition, Heartbeat, Message, Source, Tunnel
from mavlink_bridge.plan_wire import PAYLOAD_TYPE
from outrider.errors import InputError

SHARE: Final = 0.7
"""Of a line's capacity. Half-duplex radios lose the rest to turning round, headers and what is sent again."""
FLEET: Final = 8
TARGET_HZ: Final = 5.0
"""GLOBAL_POSITION_INT of the target, on the same link."""
_BITS: Final = 10
"""A byte on the line, with start and stop bit."""
_SIGNATURE: Final = 13
_SECOND: Final = 1e6
_ONE: Final = Source(1, 1)
_STATE: Final = GlobalPosition(_ONE, 1, 1.0, 1.0, 1.0, 1.0, (1.0, 1.0, 1.0), 1.0)
_PLAN: Final = Tunnel(_ONE, 0, 0, PAYLOAD_TYPE, b"\xff" * 128)
_BEAT: Final = Heartbeat(_ONE, ONBOARD_CONTROLLER, AUTOPILOT_INVALID, 0, 0, ACTIVE)


def said(config: CompanionConfig, signed: bool) -> float:
    """Bytes a second of one companion on the swarm link, at most: MAVLink 2 leaves out zeros at a message's
    end, so one that stands says less."""
    rates = config.rates
    plans = _size(_PLAN, signed) * _SECOND / rates.plan_us if config.shares_plan else 0.0
    return _size(_STATE, signed) * _SECOND / rates.state_us + plans + _size(_BEAT, signed)


def said_by_target(signed: bool) -> float:
    """Bytes a second of the target."""
    return TARGET_HZ * _size(_STATE, signed) + _size(_BEAT, signed)


def room(baud: int) -> float:
    """Bytes a second that a shared line of that ``baud`` carries, all senders together."""
    return SHARE * baud / _BITS


def carried(baud: int, config: CompanionConfig, signed: bool) -> int:
    """How many vehicles, and the target, a shared line of that ``baud`` has room for."""
    return max(0, int((room(baud) - said_by_target(signed)) / said(config, signed)))


def doubts(endpoint: Endpoint, config: CompanionConfig, signed: bool) -> str:
    """What is to be known of ``endpoint`` as the swarm link, for a fleet of eight; empty if it has room.
    InputError where there is no room for two."""
    if not isinstance(endpoint, Serial):
        return ""
    vehicles = carried(endpoint.baud, config, signed)
    if vehicles >= FLEET:
        return ""
    each = f"{said(config, signed):.0f} bytes/s each{', signed' if signed else ''}"
    has = f"--swarm {endpoint}: has {room(endpoint.baud):.0f} bytes/s as a shared radio"
    if vehicles < 2:
        raise InputError(
            f"{has}, too few for two vehicles of {each} and their target; allowed: a faster line, or slower "
            "rates: radio: 57600 in the file, or state_us and plan_us of companion.rates"
        )
    return f"{has}, enough for {vehicles} vehicles of {each}; for {FLEET} write radio: 57600 in the file"


def _size(message: Message, signed: bool) -> int:
    return len(Codec().encode(message)) + (_SIGNATURE if signed else 0)
