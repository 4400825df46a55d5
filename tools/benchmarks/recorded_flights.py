"""Flight of a real firmware from its log, and the same messages flown by the emulated autopilot.

log → messages sent to and by the vehicle → emulated autopilot, which receives the same → its messages

Time is the vehicle's own, in s since the log's first record. The time stamps of the positions received around
a message give the time at which it was sent, because simulators do not keep pace with the wall clock (PX4's
was 1.1 % slow).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from pymavlink.dialects.v20 import all as mavlink

from benchmarks.recorded_swarms import FLAVOURS
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import (
    Attitude,
    CommandAck,
    ExtendedSysState,
    Heartbeat,
    LocalPosition,
    Message,
    Source,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.errors import InputError
from sitl.config.autopilot import AutopilotConfig
from sitl.node import LINK, Autopilot
from sitl.vehicle.config import VehicleConfig

Array = npt.NDArray[np.float64]

_AUTOPILOT: Final[int] = mavlink.MAV_COMP_ID_AUTOPILOT1
"""The vehicle. Messages of all other sources in a log are sent to it."""
_SITE: Final = FleetFrame(47.397742, 8.545594, 488.0)
_TICK: Final = 5_000
"""Time (µs) between two steps of the emulated autopilot."""


class Ack(NamedTuple):
    """COMMAND_ACK (77)."""

    time: float
    command: int
    result: int


class Change(NamedTuple):
    """HEARTBEAT (0) with another mode than the one before; ``base_mode`` includes whether it is armed."""

    time: float
    custom_mode: int
    base_mode: int


class Landing(NamedTuple):
    """EXTENDED_SYS_STATE (245) whose ``landed_state`` differs from the one before."""

    time: float
    landed_state: int


class ReportedData(NamedTuple):
    """Data that a vehicle reported during a flight."""

    acks: list[Ack]
    modes: list[Change]
    landings: list[Landing]
    track: Array  # (n, 4) s, m: time and LOCAL_POSITION_NED
    headings: Array  # (n, 2) s, rad: time and yaw

    def position(self, times: Array) -> Array:
        """Return the positions (n, 3), m, at ``times`` (n,), s."""
        return np.column_stack([np.interp(times, self.track[:, 0], x) for x in self.track[:, 1:].T])


class Sent(NamedTuple):
    """Message sent to the vehicle."""

    time: float
    message: Message


class RecordedFlight(NamedTuple):
    """Flight of one vehicle."""

    system: int
    flavour: str
    sent: list[Sent]
    told: ReportedData


def read_flight(path: Path) -> RecordedFlight:
    """Return the flight of the one vehicle in a log. Raises LogError and InputError."""
    codec = Codec()
    received = [(record.time, message) for record in read_tlog(path) for message in codec.feed(record.frame)]
    beats = [m for _, m in received if isinstance(m, Heartbeat) and m.source.component == _AUTOPILOT]
    places = [(time, m.time_boot) for time, m in received if isinstance(m, LocalPosition)]
    if not beats or not places or beats[0].autopilot not in FLAVOURS:
        raise InputError(f"{path}: holds no ArduPilot or PX4 that tells where it is")
    stamps, boot = np.array(places, dtype=np.float64).T
    # Beyond its ends the time continues at the clock's own rate.
    stamps = np.array([stamps[0] - 1e9, *stamps, stamps[-1] + 1e9])
    boot = np.array([boot[0] - 1e9, *boot, boot[-1] + 1e9])
    begin = float(np.interp(received[0][0], stamps, boot))
    times = (np.interp([time for time, _ in received], stamps, boot) - begin) * 1e-6
    own = Source(beats[0].source.system, _AUTOPILOT)
    rows = list(zip(times.tolist(), (message for _, message in received), strict=True))
    sent = [Sent(time, message) for time, message in rows if message.source != own]
    told = tell((row for row in rows if row[1].source == own), begin)
    return RecordedFlight(own.system, FLAVOURS[beats[0].autopilot], sent, told)


def tell(received: Iterable[tuple[float, Message]], begin: float = 0.0) -> ReportedData:
    """Collect the data that a vehicle reported, from its messages and their times of arrival (s).

    The vehicle's own time stamps count from ``begin`` (µs).
    """
    told = ReportedData([], [], [], np.empty(0), np.empty(0))
    track, headings = [], []
    for time, message in received:
        match message:
            case CommandAck():
                told.acks.append(Ack(time, message.command, message.result))
            case Heartbeat():
                change = Change(time, message.custom_mode, message.base_mode)
                if not told.modes or change[1:] != told.modes[-1][1:]:
                    told.modes.append(change)
            case ExtendedSysState():
                if not told.landings or message.landed_state != told.landings[-1].landed_state:
                    told.landings.append(Landing(time, message.landed_state))
            case LocalPosition():
                track.append(((message.time_boot - begin) * 1e-6, *message.position_ned))
            case Attitude():
                headings.append(((message.time_boot - begin) * 1e-6, message.yaw))
    return told._replace(track=np.array(track), headings=np.array(headings))


def fly(flight: RecordedFlight, vehicle: VehicleConfig, **settings: Any) -> ReportedData:
    """Return what the emulated autopilot reports when it receives the flight's messages.

    The messages arrive at the same simulated times. ``settings`` are fields of ``AutopilotConfig`` in
    addition to those from the log.
    """
    config = AutopilotConfig(
        **{
            "system_id": flight.system,
            "flavour": flight.flavour,
            "latitude": _SITE.latitude,
            "longitude": _SITE.longitude,
            "altitude": _SITE.altitude,
            "yaw": float(flight.told.headings[0, 1]),
            **settings,
        }
    )
    autopilot = Autopilot(config, vehicle, _SITE, seed=1)
    sender, receiver = Codec(), Codec()
    received: list[tuple[float, Message]] = []
    waiting = [(math.ceil(time * 1e6 / _TICK) * _TICK, message) for time, message in flight.sent]
    waiting.reverse()
    for now in range(0, round(flight.told.track[-1, 0] * 1e6), _TICK):
        inbox = []
        while waiting and waiting[-1][0] <= now:
            inbox.append(Datagram(LINK, sender.encode(waiting.pop()[1])))
        for datagram in autopilot.step(now, inbox):
            received += [(now * 1e-6, message) for message in receiver.feed(datagram.data)]
    return tell(received)
