"""A flight of a real firmware out of its log, and the same messages flown by our emulated autopilot.

log → what was sent, and what the vehicle told → our autopilot, which is sent the same → what it told

Time is the vehicle's own, in s since the log's first record. When a message was sent is told by the stamps of
the positions that were received around it: simulators do not keep pace with the clock on the wall (PX4's was
1.1 % slow).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

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

_AUTOPILOT: Final = 1
"""MAV_COMP_ID_AUTOPILOT1: who flies. All others in a log send."""
_FLAVOURS: Final = {3: "ardupilot", 12: "px4"}
"""MAV_AUTOPILOT."""
_SITE: Final = FleetFrame(47.397742, 8.545594, 488.0)
_TICK: Final = 5_000
"""µs between two steps of our autopilot."""


class Ack(NamedTuple):
    """COMMAND_ACK (77)."""

    time: float
    command: int
    result: int


class Change(NamedTuple):
    """A HEARTBEAT (0) with another mode than the one before; ``base_mode`` says whether it is armed, too."""

    time: float
    custom_mode: int
    base_mode: int


class Landing(NamedTuple):
    """An EXTENDED_SYS_STATE (245) whose ``landed_state`` is not that of the one before."""

    time: float
    landed_state: int


class Told(NamedTuple):
    """What a vehicle told of a flight."""

    acks: list[Ack]
    modes: list[Change]
    landings: list[Landing]
    track: Array  # (n, 4) s, m: time and LOCAL_POSITION_NED
    headings: Array  # (n, 2) s, rad: time and yaw

    def position(self, times: Array) -> Array:
        """Where it was (n, 3), m, at ``times`` (n,), s."""
        return np.column_stack([np.interp(times, self.track[:, 0], x) for x in self.track[:, 1:].T])


class Sent(NamedTuple):
    """A message that somebody sent to the vehicle."""

    time: float
    message: Message


class RecordedFlight(NamedTuple):
    """One vehicle's flight."""

    system: int
    flavour: str
    sent: list[Sent]
    told: Told


def read_flight(path: Path) -> RecordedFlight:
    """The flight of the one vehicle in a log. Raises LogError and InputError."""
    codec = Codec()
    heard = [(record.time, message) for record in read_tlog(path) for message in codec.feed(record.frame)]
    beats = [m for _, m in heard if isinstance(m, Heartbeat) and m.source.component == _AUTOPILOT]
    places = [(time, m.time_boot) for time, m in heard if isinstance(m, LocalPosition)]
    if not beats or not places or beats[0].autopilot not in _FLAVOURS:
        raise InputError(f"{path}: holds no ArduPilot or PX4 that tells where it is")
    stamps, boot = np.array(places, dtype=np.float64).T
    # At its ends the log goes on at the clock's own pace.
    stamps = np.array([stamps[0] - 1e9, *stamps, stamps[-1] + 1e9])
    boot = np.array([boot[0] - 1e9, *boot, boot[-1] + 1e9])
    begin = float(np.interp(heard[0][0], stamps, boot))
    times = (np.interp([time for time, _ in heard], stamps, boot) - begin) * 1e-6
    own = Source(beats[0].source.system, _AUTOPILOT)
    rows = list(zip(times.tolist(), (message for _, message in heard), strict=True))
    sent = [Sent(time, message) for time, message in rows if message.source != own]
    told = tell((row for row in rows if row[1].source == own), begin)
    return RecordedFlight(own.system, _FLAVOURS[beats[0].autopilot], sent, told)


def tell(heard: Iterable[tuple[float, Message]], begin: float = 0.0) -> Told:
    """What a vehicle told by messages and the times when they came; its own stamps count from ``begin``
    (µs)."""
    told = Told([], [], [], np.empty(0), np.empty(0))
    track, headings = [], []
    for time, message in heard:
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


def fly(flight: RecordedFlight, vehicle: VehicleConfig, **settings: Any) -> Told:
    """What our autopilot told when it was sent the same at the same times, in simulated time. ``settings`` of
    ``AutopilotConfig`` beside those that the log says."""
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
    heard: list[tuple[float, Message]] = []
    waiting = [(math.ceil(time * 1e6 / _TICK) * _TICK, message) for time, message in flight.sent]
    waiting.reverse()
    for now in range(0, round(flight.told.track[-1, 0] * 1e6), _TICK):
        inbox = []
        while waiting and waiting[-1][0] <= now:
            inbox.append(Datagram(LINK, sender.encode(waiting.pop()[1])))
        for datagram in autopilot.step(now, inbox):
            heard += [(now * 1e-6, message) for message in receiver.feed(datagram.data)]
    return tell(heard)
