"""Companions on autopilots of our SITL in lock-step, sortie after sortie: who has landed is carried back to
its pad, gets a fresh battery and goes up again. What happens on the way is up to ``mishaps``.

A ``Seat`` is where a companion runs, and may be started anew; a ``Radio`` is what its autopilot says and
hears by, and may change both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from companion.config import CompanionConfig
from companion.node import COMPONENT, Companion
from companion.pilot import NAV_TAKEOFF
from mavlink_bridge.codec import Codec
from mavlink_bridge.ether import Channel, Ether, Faults
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.key import Key
from mavlink_bridge.messages import CommandLong, Message, SetpointLocal, Source, StatusText
from mavlink_bridge.node import Datagram
from mavlink_bridge.node_clock import NodeClock
from mavlink_bridge.runtime import LockStep, Scheduled
from mavlink_bridge.signing import Signing
from outrider import names
from outrider.beacon import Beacon
from outrider.paths import Motion
from outrider.resources import find
from outrider.yaml_file import load
from sitl.autopilot_config import AutopilotConfig
from sitl.config import VehicleConfig
from sitl.node import Autopilot
from sitl.profiles import PROFILES
from sitl.weather import WeatherConfig

EPOCH = 1_767_225_600_000_000
FLEET = FleetFrame(47.397742, 8.545594, 488.0)
FIREFLY = load(find("vehicles", "firefly"), VehicleConfig)
TARGET, FIRST, TICK, SECOND = 100, 11, 20_000, 1_000_000
HEIGHT, RADIUS, PAD = 5.0, 5.0, 15.0
"""m: of the ring above the ground and around the target; of the pads from the origin."""
FENCE = 35.0
GROUND = Source(255, 190)
SENSORS = "rtk"
NAN = math.nan
FLAVOURS = ("ardupilot", "px4")

CONFIG = CompanionConfig.model_validate(
    {
        "surface": {"kind": "circle", "radius": RADIUS, "height": HEIGHT},
        "limits": {"v_max": (4.0, 4.0, 2.0), "box_min": (-80.0, -80.0, 3.0), "box_max": (80.0, 80.0, 10.0)},
        "field": {"position_sigma": PROFILES[SENSORS].worst_axis},
        "guard": {"fence_radius": FENCE, "fence_height": 25.0},
        "rates": {"replan_us": 100_000, "setpoint_us": 40_000},
        "voice": {"texts": True},
    }
)

Edit = Callable[[Message], Sequence[Message | bytes]]
"""What becomes of a message on its way; bytes are on their way already."""


class Radio:
    """An autopilot, a ``Node``. ``outward`` and ``inward``: by name, what happens to messages on their way;
    ``said``: what a ground station on its link says next."""

    def __init__(self, make: Callable[[int], Autopilot], signing: Callable[[], Signing | None]) -> None:
        self._make, self._signing = make, signing
        self.boots = 0
        self.on = True
        self.outward: dict[str, Edit] = {}
        self.inward: dict[str, Edit] = {}
        self.said: list[Message] = []
        self.boot()
        self.name = self.autopilot.name

    def boot(self) -> None:
        """On its pad, as new."""
        self.boots += 1
        self.autopilot = self._make(self.boots)
        self.outward.clear()
        self.inward.clear()
        self.said.clear()
        # It may change what it has to sign anew.
        self._ground, self._in, self._out = (Codec(None, self._signing()) for _ in range(3))

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        if not self.on:
            return []
        link = "autopilot"
        if self.inward:
            inbox = [Datagram(link, self._edited(self._in, one.data, self.inward)) for one in inbox]
        if self.said:
            data = b"".join(map(self._ground.encode, self.said))
            inbox = [*inbox, Datagram(link, data)]
            self.said.clear()
        out = self.autopilot.step(now, inbox)
        if self.outward:
            out = [Datagram(link, self._edited(self._out, one.data, self.outward)) for one in out]
        return [one for one in out if one.data]

    def _edited(self, codec: Codec, data: bytes, edits: dict[str, Edit]) -> bytes:
        passing: list[Message | bytes] = [*codec.feed(data, whole=True)]
        for edit in list(edits.values()):
            passing = [new for one in passing for new in ((one,) if isinstance(one, bytes) else edit(one))]
        return b"".join(one if isinstance(one, bytes) else codec.encode(one) for one in passing)


class Seat:
    """A companion, a ``Node``; ``sent`` is told every set-point with its time."""

    def __init__(self, make: Callable[[], Companion], sent: Callable[[int, SetpointLocal], None]) -> None:
        self._make, self._sent = make, sent
        self.starts = 0
        self.start()
        self.name = self.companion.name

    def start(self) -> None:
        """As after a power-up."""
        self.starts += 1
        self.companion = self._make()
        self._reader = Codec(lambda identifier, _system, _component: identifier == 84)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        out = self.companion.step(now, inbox)
        for datagram in out:
            if datagram.link == "autopilot":
                for message in self._reader.feed(datagram.data, whole=True):
                    assert isinstance(message, SetpointLocal)
                    self._sent(now, message)
        return out


class Wanderer:
    """The target, a ``Node``: on a circle of ``reach`` m, or at ``aside`` for a while. It goes there at
    ``speed``, or at once (``leap``)."""

    name = names.TARGET

    def __init__(self, signing: Signing | None = None) -> None:
        self._beacon = Beacon(TARGET, "target", 5.0, FLEET)
        self._codec = Codec(None, signing)
        self._signing = signing
        self._raw = Codec()
        self.place, self.velocity = np.zeros(3), np.zeros(3)
        self.aside: np.ndarray | None = None
        self.speed, self.reach, self.silent = 1.5, 5.0, False
        self._last: int | None = None

    def leap(self, by: np.ndarray) -> None:
        """It is somewhere else."""
        self.place = self.place + by

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        dt = 1e-6 * (now - (now if self._last is None else self._last))
        self._last = now
        angle = 0.12 * 1e-6 * (now - EPOCH)
        goal = self.reach * np.array([math.cos(angle), math.sin(angle), 0.0])
        goal = goal if self.aside is None else self.aside
        off = goal - self.place
        far = float(np.linalg.norm(off))
        want = off / max(far, 1e-9) * min(self.speed, 1.0 * far)
        change = want - self.velocity
        hard = float(np.linalg.norm(change))
        self.velocity = self.velocity + change * min(1.0, dt / max(hard, 1e-9))
        self.place = self.place + dt * self.velocity
        if not self._beacon.due(now) or self.silent:
            return []
        said = self._beacon.say(now, Motion(self.place, self.velocity))
        if self._signing is None:
            return said
        self._signing.present(now)
        return [
            Datagram(link, b"".join(map(self._codec.encode, self._raw.feed(data)))) for link, data in said
        ]


class Tower:
    """The operator, a ``Node``: gives orders, hears texts."""

    name = names.OPERATOR

    def __init__(self, signing: Signing | None = None) -> None:
        self._signing = signing
        self._writer = Codec(None, signing)
        self._reader = Codec(lambda identifier, _system, _component: identifier == 253)
        self._orders: list[Message] = []
        self.heard: list[tuple[int, int, str]] = []
        """Time (µs), system, words."""

    def order(self, system: int, command: int, *params: float) -> None:
        """A COMMAND_LONG to the companion of a vehicle."""
        one, two, three, four, five, six, seven = (*params, *[0.0] * 7)[:7]
        self._orders.append(
            CommandLong(GROUND, system, COMPONENT, command, 0, (one, two, three, four, five, six, seven))
        )

    def go(self, system: int) -> None:
        """Up, or on."""
        self.order(system, NAV_TAKEOFF, 0.0, 0.0, 0.0, NAN, NAN, NAN, HEIGHT)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        for datagram in inbox:
            for message in self._reader.feed(datagram.data, whole=True):
                if isinstance(message, StatusText):
                    self.heard.append((now, message.source.system, message.text))
        if self._signing is not None:
            self._signing.present(now)
        data = b"".join(map(self._writer.encode, self._orders))
        self._orders.clear()
        return [Datagram("ground", data)] if data else []


@dataclass
class Craft:
    """A vehicle and its companion."""

    system: int
    flavour: str
    radio: Radio
    seat: Seat
    pad: np.ndarray
    marks: dict[str, Any] = field(default_factory=dict)

    @property
    def companion(self) -> Companion:
        return self.seat.companion

    @property
    def autopilot(self) -> Autopilot:
        return self.radio.autopilot

    @property
    def place(self) -> np.ndarray:
        """Where it truly is, (3,) m ENU."""
        north, east, down = self.autopilot.state.position
        return np.array([east, north, -down])

    @property
    def speed(self) -> float:
        return float(np.linalg.norm(self.autopilot.state.velocity))


class Airfield:
    """``count`` vehicles of both flavours on their pads. ``sent``: told each set-point: vehicle, time,
    message. ``key``: everybody's. ``guests``: other nodes; their ``places`` are the names of their channels,
    and of the links there. Nodes that are ``deaf`` do not hear them."""

    def __init__(
        self,
        count: int,
        seed: int,
        sent: Callable[[int, int, SetpointLocal], None],
        key: Key | None = None,
        config: CompanionConfig = CONFIG,
        guests: Sequence[Any] = (),
        deaf: Sequence[str] = (),
    ) -> None:
        self.config, self.seed, self._key = config, seed, key
        self.target = Wanderer(self._signing())
        self.tower = Tower(self._signing())
        self.crafts = [self._craft(k, count, sent) for k in range(count)]
        self.ether = Ether(self._channels(guests, deaf), seed, TICK // 2)
        nodes = [Scheduled(craft.radio, TICK, EPOCH) for craft in self.crafts]
        for k, craft in enumerate(self.crafts):
            clock = NodeClock(250 * (k - 1) * 4, 15.0 * (k - 1), EPOCH)
            nodes.append(Scheduled(craft.seat, TICK, EPOCH + TICK // 2 * (k % 2), clock))
        nodes += [Scheduled(node, TICK, EPOCH) for node in (self.target, self.tower, *guests)]
        self.loop = LockStep(nodes, self.ether, TICK // 2)

    def _signing(self) -> Signing | None:
        return None if self._key is None else Signing(self._key)

    def _craft(self, k: int, count: int, sent: Callable[[int, int, SetpointLocal], None]) -> Craft:
        system, flavour = FIRST + k, FLAVOURS[k % 2]
        angle = 2.0 * math.pi * k / count + 0.3
        pad = PAD * np.array([math.cos(angle), math.sin(angle), 0.0])
        latitude, longitude, altitude = FLEET.to_geodetic(pad)
        config = AutopilotConfig(
            system_id=system,
            flavour=flavour,
            latitude=latitude,
            longitude=longitude,
            altitude=altitude,
            sensors=SENSORS,
            guided_timeout=1.0,
            epoch=EPOCH,
        )
        weather = WeatherConfig(wind=(1.5, -1.0, 0.0))
        radio = Radio(
            lambda boots: Autopilot(
                config, FIREFLY, FLEET, self.seed + 1000 * boots, weather=weather, signing=self._signing()
            ),
            self._signing,
        )
        seat = Seat(
            lambda: Companion(self.config, system, TARGET, FLEET, lambda: 0, self._signing()),
            lambda now, message: sent(system, now, message),
        )
        return Craft(system, flavour, radio, seat, pad)

    def _channels(self, guests: Sequence[Any], deaf: Sequence[str]) -> list[Channel]:
        radio, lan = Faults(delay=20_000, jitter=10_000, loss=0.05), Faults(delay=5_000)
        members: dict[str, dict[str, str]] = {"swarm": {}, "target": {self.target.name: "target"}}
        for craft in self.crafts:
            seat, system = craft.seat.name, craft.system
            members["swarm"][seat] = "swarm"
            members["target"][seat] = "target"
            members[f"autopilot-{system}"] = {seat: "autopilot", craft.radio.name: "autopilot"}
            members[f"ground-{system}"] = {seat: "ground", self.tower.name: "ground"}
        for guest in guests:
            for channel, link in guest.places.items():
                members[channel][guest.name] = link
        nothing = {(guest.name, node): Faults(loss=1.0) for guest in guests for node in deaf}
        return [
            Channel(
                name,
                nodes,
                radio if name in ("swarm", "target") else lan,
                {pair: faults for pair, faults in nothing.items() if {*pair} <= nodes.keys()},
            )
            for name, nodes in members.items()
        ]
