"""Companions on autopilots of our SITL in lock-step, sortie after sortie: who has landed is carried back to
its pad, gets a fresh battery and goes up again. What happens on the way is up to ``mishaps``."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from companion.config import CompanionConfig
from companion.node import Companion
from mavlink_bridge.clocks.node_clock import NodeClock
from mavlink_bridge.key import Key
from mavlink_bridge.loops.lockstep import LockStep, Scheduled
from mavlink_bridge.messages import SetpointLocal
from mavlink_bridge.network.simulated import Channel, Faults, SimulatedNetwork
from mavlink_bridge.wire.signing import Signing
from sitl.config.autopilot import AutopilotConfig
from sitl.environment.weather import WeatherConfig
from sitl.estimation.profiles import PROFILES
from sitl.node import Autopilot
from tests.soak.air_nodes import (
    EPOCH,
    FENCE,
    FIREFLY,
    FIRST,
    FLAVOURS,
    FLEET,
    HEIGHT,
    PAD,
    RADIUS,
    SENSORS,
    TARGET,
    TICK,
    Radio,
    RestartableCompanion,
    Tower,
    Wanderer,
)

CONFIG = CompanionConfig.model_validate(
    {
        "surface": {"kind": "circle", "radius": RADIUS, "height": HEIGHT},
        "limits": {"v_max": (4.0, 4.0, 2.0), "box_min": (-80.0, -80.0, 3.0), "box_max": (80.0, 80.0, 10.0)},
        "field": {"position_sigma": PROFILES[SENSORS].worst_axis},
        "guard": {"fence_radius": FENCE, "fence_height": 25.0},
        "rates": {"replan_us": 100_000, "setpoint_us": 40_000},
        "ground_messages": {"texts": True},
    }
)


@dataclass
class Craft:
    """A vehicle and its companion."""

    system: int
    flavour: str
    radio: Radio
    slot: RestartableCompanion
    pad: np.ndarray
    marks: dict[str, Any] = field(default_factory=dict)

    @property
    def companion(self) -> Companion:
        return self.slot.companion

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
        self.network = SimulatedNetwork(self._channels(guests, deaf), seed, TICK // 2)
        nodes = [Scheduled(craft.radio, TICK, EPOCH) for craft in self.crafts]
        for k, craft in enumerate(self.crafts):
            clock = NodeClock(250 * (k - 1) * 4, 15.0 * (k - 1), EPOCH)
            nodes.append(Scheduled(craft.slot, TICK, EPOCH + TICK // 2 * (k % 2), clock))
        nodes += [Scheduled(node, TICK, EPOCH) for node in (self.target, self.tower, *guests)]
        self.loop = LockStep(nodes, self.network, TICK // 2)

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
        slot = RestartableCompanion(
            lambda: Companion(self.config, system, TARGET, FLEET, lambda: 0, self._signing()),
            lambda now, message: sent(system, now, message),
        )
        return Craft(system, flavour, radio, slot, pad)

    def _channels(self, guests: Sequence[Any], deaf: Sequence[str]) -> list[Channel]:
        radio, lan = Faults(delay=20_000, jitter=10_000, loss=0.05), Faults(delay=5_000)
        members: dict[str, dict[str, str]] = {"swarm": {}, "target": {self.target.name: "target"}}
        for craft in self.crafts:
            slot, system = craft.slot.name, craft.system
            members["swarm"][slot] = "swarm"
            members["target"][slot] = "target"
            members[f"autopilot-{system}"] = {slot: "autopilot", craft.radio.name: "autopilot"}
            members[f"ground-{system}"] = {slot: "ground", self.tower.name: "ground"}
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
