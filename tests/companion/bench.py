"""A companion on the bench: its autopilot is a few lines that do exactly what they are told; time runs when a
test says so, and everything goes through bytes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import count
from typing import Any, TypeVar

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.flight.autopilots import Profile
from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.flight.autopilots.px4 import PX4
from companion.node import Companion
from companion.planning.field import FieldAvoidance
from companion.values.components import COMPONENT
from companion.values.phase import Phase
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.key import Key
from mavlink_bridge.messages import (
    Attitude,
    CommandAck,
    CommandInt,
    CommandLong,
    ExtendedSysState,
    GlobalPosition,
    GpsGlobalOrigin,
    Heartbeat,
    LocalPosition,
    Message,
    SetpointLocal,
    Source,
    SysStatus,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing

PROFILES = {"ardupilot": ARDUPILOT, "px4": PX4}
FLAVOURS = tuple(PROFILES)
HOLDING = np.array([0.0, 0.0, 5.0])
"""Place (m) of the vehicle of ``flying``."""
FLEET = FleetFrame(47.397742, 8.545594, 488.0)
SYSTEM, TARGET = 11, 1
AUTOPILOT, GROUND = Source(SYSTEM, 1), Source(255, 190)
START = 1_767_225_600_000_000
TICK = 10_000
LINKS = ("autopilot", "swarm", "target", "ground")

ORIGIN_REQUEST = (mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
NAN = math.nan

M = TypeVar("M", bound=Message)


def field_of(companion: Companion) -> FieldAvoidance:
    """Return the avoidance of a ``companion`` that avoids by the field."""
    assert isinstance(companion.avoidance, FieldAvoidance)
    return companion.avoidance


class PerfectAutopilot:
    """Grants every command, climbs at 2 m/s and is where its set-points say. Its origin is the fleet's."""

    def __init__(self, profile: Profile, start: Any, key: Key | None = None) -> None:
        self.profile = profile
        self.home = np.asarray(start, dtype=float)
        self.position, self.velocity, self.yaw = self.home.copy(), np.zeros(3), 0.0
        self.armed, self.mode, self.landing = False, 0, False
        self.mute = False
        self.battery = 0.9
        self.received: list[Message] = []
        self._local = FLEET.local(FLEET.latitude, FLEET.longitude, FLEET.altitude)
        self._climb: float | None = None
        self._signing = Signing(key)
        self._codec = Codec(None, self._signing)

    def step(self, now: int, data: bytes) -> bytes:
        """What it says (``mute``: heartbeats only) after ``data``."""
        answers: list[Message] = []
        self._signing.present(now)
        for message in self._codec.feed(data):
            self.received.append(message)
            if isinstance(message, CommandLong):
                answers += self._obey(message)
            elif isinstance(message, SetpointLocal) and self.armed and self._guided:
                self.position = self._local.position_to_fleet(message.position)
                self.velocity = self._local.velocity_to_fleet(message.velocity)
                self.yaw = self._local.yaw_to_fleet(message.yaw)
        self._move()
        boot = now - START
        if now % 100_000 == 0:
            mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED * self.armed
            answers.append(Heartbeat(AUTOPILOT, 2, self.profile.autopilot, mode, self.mode, 4))
            checks = mavlink.MAV_SYS_STATUS_PREARM_CHECK
            answers.append(SysStatus(AUTOPILOT, checks, checks, checks, 12.0, self.battery))
            answers.append(ExtendedSysState(AUTOPILOT, 0, 2 if self.position[2] > self.home[2] + 0.1 else 1))
        if now % 20_000 == 0 and not self.mute:
            answers += [self.local(boot), self.attitude(boot)]
        return b"".join(map(self._codec.encode, answers))

    def local(self, boot: int = 0) -> LocalPosition:
        """LOCAL_POSITION_NED as it is now."""
        x, v = (
            self._local.position_to_local(self.position).tolist(),
            self._local.velocity_to_local(self.velocity).tolist(),
        )
        return LocalPosition(AUTOPILOT, boot, (x[0], x[1], x[2]), (v[0], v[1], v[2]))

    def attitude(self, boot: int = 0) -> Attitude:
        """ATTITUDE as it is now."""
        return Attitude(AUTOPILOT, boot, 0.0, 0.0, self._local.yaw_to_local(self.yaw), (0.0, 0.0, 0.0))

    @property
    def _guided(self) -> bool:
        return self.mode == self.profile.guided_custom_mode

    def _obey(self, message: CommandLong) -> list[Message]:
        p = message.params
        answers: list[Message] = [
            CommandAck(AUTOPILOT, message.command, 0, 0, 0, message.source.system, message.source.component)
        ]
        if message.command == mavlink.MAV_CMD_DO_SET_MODE:
            held = p == self.profile.hold_call
            self.mode = self.profile.hold_mode if held else self.profile.guided_custom_mode
        elif message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self.armed = p[0] == 1.0
        elif message.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            height = p[6] - FLEET.altitude if self.profile.takeoff_absolute else self.home[2] + p[6]
            self._climb = height
            self.mode = min(self.profile.takeoff_modes, default=self.mode)
        elif message.command == mavlink.MAV_CMD_NAV_LAND:
            self.landing, self.mode = True, min(self.profile.land_modes)
        elif (message.command, p[0]) == ORIGIN_REQUEST:
            answers.append(GpsGlobalOrigin(AUTOPILOT, FLEET.latitude, FLEET.longitude, FLEET.altitude, 0))
        return answers

    def _move(self) -> None:
        if self.landing:
            self.velocity = np.array([0.0, 0.0, -2.0])
            self.position = self.position + 0.01 * self.velocity
            if self.position[2] <= self.home[2]:
                self.armed = False
        elif self._climb is not None:
            left = self._climb - self.position[2]
            self.velocity = np.array([0.0, 0.0, 2.0 if left > 0.02 else 0.0])
            self.position = self.position + 0.01 * self.velocity
            if left <= 0.02:
                self._climb = None


class Bench:
    """``fly`` lets time pass; ``sent`` holds everything the companion sent, as (time, link, message).
    ``key``: the companion's; ``others``: that of all others."""

    def __init__(
        self,
        flavour: str = "ardupilot",
        start: Any = (0.0, 0.0, 0.0),
        key: Key | None = None,
        others: Key | None = None,
        **settings: Any,
    ) -> None:
        settings = {"task": "goto", "rates": {"replan_us": 50_000}, **settings}
        self.config = CompanionConfig.model_validate(settings)
        stopwatch = count()
        signing = None if key is None else Signing(key)
        self.companion = Companion(self.config, SYSTEM, TARGET, FLEET, lambda: next(stopwatch), signing)
        self.autopilot = PerfectAutopilot(PROFILES[flavour], start, others)
        self.now = START
        self.sent: list[tuple[int, str, Message]] = []
        self.target: GlobalPosition | None = None
        self._readers = {link: Codec() for link in LINKS}
        self._ground = Signing(others)
        self._writer = Codec(None, self._ground)
        self._to_autopilot = b""

    @property
    def phase(self) -> Phase:
        return self.companion.pilot.phase

    def step(self, *inbox: Datagram) -> list[tuple[str, Message]]:
        """One tick; what the companion sent in it."""
        datagrams = [Datagram("autopilot", self.autopilot.step(self.now, self._to_autopilot)), *inbox]
        if self.target is not None and self.now % 100_000 == 0:
            datagrams.append(self.datagram("target", self.target))
        self._to_autopilot = b""
        sent = []
        for link, data in self.companion.step(self.now, [d for d in datagrams if d.data]):
            if link == "autopilot":
                self._to_autopilot += data
            sent += [(link, message) for message in self._readers[link].feed(data)]
        assert not any(reader.counters.bad for reader in self._readers.values())
        self.sent += [(self.now, link, message) for link, message in sent]
        self.now += TICK
        return sent

    def fly(self, seconds: float, *every: Datagram) -> list[tuple[str, Message]]:
        """Let time pass, with ``every`` in each inbox."""
        sent = []
        for _ in range(round(seconds * 1e6 / TICK)):
            sent += self.step(*every)
        return sent

    def until(self, phase: Phase, seconds: float = 30.0) -> Bench:
        """Let time pass until the flight has got so far."""
        for _ in range(round(seconds * 1e6 / TICK)):
            if self.phase is phase:
                return self
            self.step()
        raise AssertionError(f"{self.phase} after {seconds} s: {self.companion.pilot.waiting_for}")

    def order(self, command: int, *params: float, link: str = "ground", to: int = SYSTEM) -> list[CommandAck]:
        """Send a COMMAND_LONG; the acknowledgements that come back on the ground link."""
        values: Any = (*map(float, params), *[0.0] * 7)[:7]
        message = CommandLong(GROUND, to, COMPONENT, command, 0, values)
        return only(CommandAck, self.step(self.datagram(link, message)), "ground")

    def go_to(self, position: Any) -> list[CommandAck]:
        """Send a DO_REPOSITION."""
        latitude, longitude, altitude = FLEET.to_geodetic(position)
        return self.reposition(round(latitude * 1e7), round(longitude * 1e7), altitude)

    def reposition(self, x: int, y: int, z: float, frame: int = 0) -> list[CommandAck]:
        """Send a DO_REPOSITION of raw numbers."""
        message = CommandInt(
            GROUND, SYSTEM, COMPONENT, frame, mavlink.MAV_CMD_DO_REPOSITION, (-1.0, 0.0, 0.0, NAN), x, y, z
        )
        return only(CommandAck, self.step(self.datagram("ground", message)), "ground")

    def take_off(self, height: float = 5.0) -> Bench:
        """Into the air and under the companion's control."""
        assert [
            ack.result for ack in self.order(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, height)
        ] == [0]
        return self.until(Phase.ESCORT)

    def datagram(self, link: str, *messages: Message) -> Datagram:
        self._ground.present(self.now)
        return Datagram(link, b"".join(map(self._writer.encode, messages)))


def only(kind: type[M], sent: Iterable[tuple[str, Message]], link: str = "autopilot") -> list[M]:
    """The messages of one kind on one link."""
    return [message for name, message in sent if name == link and isinstance(message, kind)]


def setpoints(sent: Iterable[tuple[str, Message]]) -> list[SetpointLocal]:
    return only(SetpointLocal, sent)


def commands(sent: Iterable[tuple[str, Message]]) -> list[int]:
    """What is asked of the autopilot beside messages."""
    return [
        m.command
        for m in only(CommandLong, sent)
        if m.command not in (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE)
    ]


def numbers_of(message: SetpointLocal) -> list[float]:
    """Every number that an autopilot may fly by."""
    return [
        *message.position,
        *message.velocity,
        *message.acceleration,
        message.yaw,
        message.yaw_rate,
    ]


def seen_at(system: int, position: Any, velocity_ned: Any = (0.0, 0.0, 0.0)) -> GlobalPosition:
    """GLOBAL_POSITION_INT of a system at an ENU position."""
    latitude, longitude, altitude = FLEET.to_geodetic(position)
    return GlobalPosition(Source(system, 1), 0, latitude, longitude, altitude, 0.0, velocity_ned, None)
