"""Link budget: bytes per second on the swarm and autopilot links, and the capacity of a serial line."""

from __future__ import annotations

from bisect import bisect
from math import ceil
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.config.target_source import FusedSource
from companion.flight.readiness import HEALTH, SLOW_HEALTH, SLOW_STREAMS, STREAMS
from companion.telemetry.sharing import forwarded, onboard_heartbeat
from mavlink_bridge.links.endpoints import BAUD_RATES, Endpoint, Serial
from mavlink_bridge.messages import (
    Attitude,
    CameraFovStatus,
    CameraTrackingGeo,
    EstimatorStatus,
    ExtendedSysState,
    GlobalPosition,
    GpsRaw,
    LocalPosition,
    Message,
    SetpointLocal,
    Source,
    SysStatus,
    Timesync,
    Tunnel,
    Vector,
)
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Entry, Statement, in_messages, pack
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
_DETECTION: Final = forwarded(
    _ONE,
    1_000,
    CameraFovStatus(_ONE, 1, (1.0, 1.0, 1.0), None, (1.0, 0.0, 0.0, 0.0), 1.0, 1.0),
    CameraTrackingGeo(_ONE, 1, 1.0, 1.0, 1.0, None, 1.0, 1.0, None, 1.0, 1.0, 1.0, 1),
)
_EPOCH: Final = (1 << 56) - 1
_TIMESYNC: Final = Timesync(_ONE, -1, -1)
_TIMESYNC_US: Final = 1_000_000
"""Time (µs) between two requests for the others' clocks in certified mode."""
_MOST: Final = 255
"""Largest number of vehicles with different system ids."""
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


def said(config: CompanionConfig, signed: bool, vehicles: int = FLEET, *, in_loss: bool = False) -> float:
    """Return the maximum bytes per second of one companion of ``vehicles`` on the swarm link.

    ``in_loss``: while most transmissions are lost, see ``agreed``.
    They are states, plans, forwarded detections, heartbeats and, in certified mode, all of ``agreed``.
    MAVLink 2 truncates zeros at the end of a message, so a vehicle at rest sends less.
    """
    rates = config.rates
    if config.avoidance == "certified":
        plans = agreed(config, signed, vehicles, in_loss=in_loss)
    else:
        plans = _size(_PLAN, signed) * _SECOND / rates.plan_us if config.shares_plan else 0.0
    states = _size(_STATE, signed) * _SECOND / rates.state_us
    return states + plans + _detections(config, signed) + _size(_BEAT, signed)


def _detections(config: CompanionConfig, signed: bool) -> float:
    """Return the maximum bytes per second of forwarded detections."""
    source = config.target_source
    if not isinstance(source, FusedSource) or not source.share:
        return 0.0
    pair = sum(_size(message, signed) for message in _DETECTION)
    return pair * _SECOND / config.rates.detection_us


def agreed(config: CompanionConfig, signed: bool, vehicles: int, *, in_loss: bool = False) -> float:
    """Return the maximum bytes per second of plans, statements of agreements and TIMESYNC in certified mode.

    The plan and a statement of all agreements go once in ``repeat_us``, and ``in_loss``, while most
    transmissions are lost, ``repeat_in_loss`` times as often. The first statement of an epoch has
    two agreements with each of the other ``vehicles``, the old and the new one; that the new one replaces the
    old one is stated to each of them at once. Lost messages are not counted: with 40 % loss and 80 ms of
    delay, eight vehicles send twice as much, because more plans and agreements are open. Nor are goals, which
    vehicles tell in flights in a plane, and while they ask for room: 45 bytes (signed 58) with each plan.
    """
    certified, peers = config.certified, vehicles - 1
    period = certified.repeat_us / (certified.repeat_in_loss if in_loss else 1.0)
    announcements = ceil(certified.epoch_us / period)
    old, both, one = (_stated(count, number, signed) for count, number in ((peers, 1), (peers, 2), (1, 1)))
    epoch = announcements * _size(_PLAN, signed) + both + (announcements - 1) * old + peers * one
    clocks = vehicles * _size(_TIMESYNC, signed) * _SECOND / _TIMESYNC_US
    return epoch * _SECOND / certified.epoch_us + clocks


def _stated(peers: int, agreements: int, signed: bool) -> int:
    """Return the bytes of a statement with ``agreements`` with each of ``peers``, in all its messages."""
    one = _EPOCH, _EPOCH
    entries = tuple(Entry(_MOST, (one,) * agreements, one) for _ in range(peers))
    parts = in_messages(Statement(_EPOCH & 0xFFFFFFFF, _EPOCH, _EPOCH, entries))
    return sum(_size(Tunnel(_ONE, 0, 0, AGREEMENTS, pack(part)), signed) for part in parts)


def said_by_target(signed: bool) -> float:
    """Return the bytes per second that the target sends."""
    return TARGET_HZ * _size(_STATE, signed) + _size(_BEAT, signed)


def room(baud: int) -> float:
    """Return the usable bytes per second of a shared line of ``baud``, for all senders together."""
    return SHARE * baud / _BITS


def carried(baud: int, config: CompanionConfig, signed: bool) -> int:
    """Return how many vehicles, besides the target, a shared line of ``baud`` has room for."""
    left = room(baud) - said_by_target(signed)
    counts = range(1, _MOST + 1)
    # The bytes of one companion grow with the number of companions.
    return bisect(counts, left, key=lambda vehicles: vehicles * said(config, signed, vehicles))


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
    each = f"{said(config, signed, max(vehicles, 2)):.0f} bytes/s each{', signed' if signed else ''}"
    has = f"--swarm {endpoint}: has {room(endpoint.baud):.0f} bytes/s as a shared radio"
    if config.avoidance == "certified":
        slower = "a faster line, or longer epoch_us and repeat_us of companion.certified"
        more = said(config, signed, max(vehicles, 2), in_loss=True)
        enough = f"take {slower}; while most messages are lost each sends {more:.0f} bytes/s (repeat_in_loss)"
    else:
        rates = "radio: 57600 in the file, or state_us and plan_us of companion.rates"
        slower, enough = f"a faster line, or slower rates: {rates}", "write radio: 57600 in the file"
    if vehicles < 2:
        raise InputError(f"{has}, too few for two vehicles of {each} and their target; allowed: {slower}")
    return f"{has}, enough for {vehicles} vehicles of {each}; for {FLEET} {enough}"


def steered(config: CompanionConfig, signed: bool) -> float:
    """Return the bytes per second of set-points and heartbeats to an autopilot under control.

    Beside them the companion asks for the origin every 10 s, which is not counted: 4 bytes/s.
    """
    setpoints = _size(_SETPOINT, signed) * _SECOND / config.rates.setpoint_us
    return setpoints + _size(_BEAT, signed)


def reported(signed: bool, *, slow: bool = False) -> float:
    """Return the bytes per second that an autopilot sends: requested streams and its heartbeat.

    ``slow``: as a dry run requests them.
    """
    intervals, health_us = (SLOW_STREAMS, SLOW_HEALTH) if slow else (STREAMS, HEALTH)
    streams = sum(_size(_TOLD[number], signed) * _SECOND / each for number, each in intervals.items())
    health = sum(_size(message, signed) for message in _HEALTH) * _SECOND / health_us
    return streams + health + _size(_BEAT, signed)


def doubts_of_autopilot(endpoint: Endpoint, config: CompanionConfig, signed: bool, *, dry_run: bool) -> str:
    """Return a warning about ``endpoint`` as autopilot link; empty if there is none.

    There is none for a line with room, a USB device, or an endpoint that is no serial line. A dry run
    requires room for twice the autopilot's traffic: a ground station uses as much.
    """
    if not isinstance(endpoint, Serial) or _USB in endpoint.device:
        return ""
    to, back = 0.0 if dry_run else steered(config, signed), reported(signed, slow=dry_run)
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
