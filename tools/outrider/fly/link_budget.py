"""Link budget: bytes per second on the swarm and autopilot links, and the capacity of a serial line."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.readiness import HEALTH, STREAMS
from companion.telemetry.sharing import onboard_heartbeat
from mavlink_bridge.links.endpoints import BAUD_RATES, Endpoint, Serial
from mavlink_bridge.messages import (
    Attitude,
    EstimatorStatus,
    ExtendedSysState,
    GlobalPosition,
    GpsRaw,
    LocalPosition,
    Message,
    SetpointLocal,
    Source,
    SysStatus,
    Tunnel,
    Vector,
)
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE
from outrider.errors import InputError

SHARE: Final = 0.7
"""Usable share of a line's capacity.

Half-duplex radios use the rest for turnaround, headers and retransmission.
"""
FLEET: Final = 8
TARGET_HZ: Final = 5.0
"""Rate of the target's GLOBAL_POSITION_INT on the same link (Hz)."""
_BITS: Final = 10
"""Bits per byte on the line, with start and stop bit."""
_SECOND: Final = 1e6
_ONE: Final = Source(1, 1)
_STATE: Final = GlobalPosition(_ONE, 1, 1.0, 1.0, 1.0, 1.0, (1.0, 1.0, 1.0), 1.0)
_PLAN: Final = Tunnel(_ONE, 0, 0, PAYLOAD_TYPE, b"\xff" * 128)
_BEAT: Final = onboard_heartbeat(_ONE)
_ANY: Final[Vector] = (1.0, 1.0, 1.0)
_SETPOINT: Final = SetpointLocal(_ONE, 1, 1, 1, 1, 1, _ANY, _ANY, _ANY, 1.0, 1.0)
_TOLD: Final[dict[int, Message]] = {
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: SysStatus(_ONE, 1, 1, 1, 1.0, 1.0),
    mavlink.MAVLINK_MSG_ID_ATTITUDE: Attitude(_ONE, 1, 1.0, 1.0, 1.0, _ANY),
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: LocalPosition(_ONE, 1, _ANY, _ANY),
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: ExtendedSysState(_ONE, 1, 1),
}
_HEALTH: Final[tuple[Message, ...]] = (
    GpsRaw(_ONE, 1, 3, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 9, 1.0, 1.0, 1.0, 1.0),
    EstimatorStatus(_ONE, 1, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1),
)
"""Health messages of PX4; ArduPilot's estimator message is shorter."""
_USB: Final = "ttyACM"
"""Part of the name of USB serial devices, whose baud rate has no effect."""


def said(config: CompanionConfig, signed: bool) -> float:
    """Return the maximum bytes per second of one companion's states, plans and heartbeats on the swarm link.

    MAVLink 2 truncates zeros at the end of a message, so a vehicle at rest sends less.
    """
    rates = config.rates
    plans = _size(_PLAN, signed) * _SECOND / rates.plan_us if config.shares_plan else 0.0
    return _size(_STATE, signed) * _SECOND / rates.state_us + plans + _size(_BEAT, signed)


def said_by_target(signed: bool) -> float:
    """Return the bytes per second that the target sends."""
    return TARGET_HZ * _size(_STATE, signed) + _size(_BEAT, signed)


def room(baud: int) -> float:
    """Return the usable bytes per second of a shared line of ``baud``, for all senders together."""
    return SHARE * baud / _BITS


def carried(baud: int, config: CompanionConfig, signed: bool) -> int:
    """Return how many vehicles, besides the target, a shared line of ``baud`` has room for."""
    return max(0, int((room(baud) - said_by_target(signed)) / said(config, signed)))


def doubts(endpoint: Endpoint, config: CompanionConfig, signed: bool) -> str:
    """Return a warning about ``endpoint`` as swarm link of a fleet of eight; empty if there is none.

    There is none for a line with room, or for an endpoint that is no serial line. Raises InputError if there
    is no room for two vehicles.
    """
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
    """Return the bytes per second of set-points and heartbeats to an autopilot under control."""
    setpoints = _size(_SETPOINT, signed) * _SECOND / config.rates.setpoint_us
    return setpoints + _size(_BEAT, signed)


def reported(signed: bool) -> float:
    """Return the bytes per second that an autopilot sends: requested streams and its heartbeat."""
    streams = sum(_size(_TOLD[number], signed) * _SECOND / each for number, each in STREAMS.items())
    health = sum(_size(message, signed) for message in _HEALTH) * _SECOND / HEALTH
    return streams + health + _size(_BEAT, signed)


def doubts_of_autopilot(endpoint: Endpoint, config: CompanionConfig, signed: bool, *, dry_run: bool) -> str:
    """Return a warning about ``endpoint`` as autopilot link; empty if there is none.

    There is none for a line with room, a USB device, or an endpoint that is no serial line. A dry run
    requires room for twice the autopilot's traffic: a ground station uses as much.
    """
    if not isinstance(endpoint, Serial) or _USB in endpoint.device:
        return ""
    to, back = 0.0 if dry_run else steered(config, signed), reported(signed)
    need = 2.0 * back if dry_run else to + back
    if need <= room(endpoint.baud):
        return ""
    whole = endpoint.baud / _BITS
    enough = next((baud for baud in BAUD_RATES if need <= room(baud)), BAUD_RATES[-1])
    setpoints = "" if dry_run else f"set-points take {to:.0f} bytes/s, and "
    short = "too much even for a cable" if max(to, back) > whole else "too much for a radio"
    if dry_run and need <= 2.0 * room(endpoint.baud):
        short = "on a radio too little is left for a ground station"
    return (
        f"--autopilot {endpoint}: {setpoints}what comes back takes {back:.0f}, of {whole:.0f} bytes/s each "
        f"way: {short}; needed: {enough} baud"
    )


def _size(message: Message, signed: bool) -> int:
    size = len(Codec().encode(message))
    return size + (mavlink.MAVLINK_SIGNATURE_BLOCK_LEN if signed else 0)
