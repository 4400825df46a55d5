"""What a swarm says over its link each second, what goes to an autopilot and back, and what a line has room
for."""

from __future__ import annotations

from typing import Final

from companion.config import CompanionConfig
from companion.pilot import STREAMS
from companion.sharing import ACTIVE, AUTOPILOT_INVALID, ONBOARD_CONTROLLER
from mavlink_bridge.codec import Codec
from mavlink_bridge.links.endpoints import Endpoint, Serial
from mavlink_bridge.messages import (
    Attitude,
    ExtendedSysState,
    GlobalPosition,
    Heartbeat,
    LocalPosition,
    Message,
    SetpointLocal,
    Source,
    SysStatus,
    Tunnel,
    Vector,
)
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
_ANY: Final[Vector] = (1.0, 1.0, 1.0)
_SETPOINT: Final = SetpointLocal(_ONE, 1, 1, 1, 1, 1, _ANY, _ANY, _ANY, 1.0, 1.0)
_TOLD: Final[dict[int, Message]] = {
    1: SysStatus(_ONE, 1, 1, 1, 1.0, 1.0),
    30: Attitude(_ONE, 1, 1.0, 1.0, 1.0, _ANY),
    32: LocalPosition(_ONE, 1, _ANY, _ANY),
    245: ExtendedSysState(_ONE, 1, 1),
}
_FULL: Final = 0.4
"""Share of an autopilot's line, one way, from which on it is told. A half-duplex radio, which carries 0.7
both ways together, has no room for as much again, be it set-points or a ground station's telemetry."""


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


def steered(config: CompanionConfig, signed: bool) -> float:
    """Bytes a second that go to an autopilot that is steered."""
    setpoints = _size(_SETPOINT, signed) * _SECOND / config.rates.setpoint_us
    return setpoints + _size(_BEAT, signed)


def told(signed: bool) -> float:
    """Bytes a second of what is asked of an autopilot."""
    streams = sum(_size(_TOLD[number], signed) * _SECOND / each for number, each in STREAMS.items())
    return streams + _size(_BEAT, signed)


def doubts_of_autopilot(endpoint: Endpoint, config: CompanionConfig, signed: bool, *, dry_run: bool) -> str:
    """What is to be known of ``endpoint`` as the way to the autopilot; empty if it has room."""
    if not isinstance(endpoint, Serial):
        return ""
    whole, to, back = endpoint.baud / _BITS, steered(config, signed), told(signed)
    if max(back, 0.0 if dry_run else to) <= _FULL * whole:
        return ""
    asked = f"--autopilot {endpoint}: what is asked of the autopilot takes {back:.0f} of {whole:.0f} bytes/s"
    if dry_run:
        return f"{asked}; on a radio that leaves little for a ground station: 115200 baud or more is better"
    return f"{asked}, set-points {to:.0f} the other way: too much for a radio; needed: 115200 baud or more"


def _size(message: Message, signed: bool) -> int:
    return len(Codec().encode(message)) + (_SIGNATURE if signed else 0)
