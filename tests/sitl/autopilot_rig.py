"""An autopilot on the bench: time runs when a test says so, messages go in and come out as bytes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import (
    CommandAck,
    CommandLong,
    Message,
    SetpointLocal,
    Source,
    StatusText,
    Vector,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from sitl.autopilot.saved import Saved
from sitl.config.autopilot import AutopilotConfig
from sitl.node import LINK, Autopilot
from sitl.vehicle.config import VehicleConfig

CONFIG = Path(__file__).parents[2] / "config" / "vehicles" / "firefly.yaml"
FIREFLY = VehicleConfig.model_validate(yaml.safe_load(CONFIG.read_text()))
SITE = FleetFrame(47.397742, 8.545594, 488.0)
PILOT = Source(11, 191)
FLAVOURS = ("ardupilot", "px4")
ZERO = (0.0, 0.0, 0.0)

POSITION_YAW = 0x9F8
VELOCITY_YAW = 0x9C7
ALL = 0x000

SET_MODE, ARM, TAKEOFF, LAND, INTERVAL, REQUEST = 176, 400, 22, 21, 511, 512
GUIDED = {"ardupilot": (1, 4), "px4": (1, 6)}

M = TypeVar("M", bound=Message)


def setpoint(
    mask: int = POSITION_YAW,
    position: Vector = ZERO,
    velocity: Vector = ZERO,
    acceleration: Vector = ZERO,
    yaw: float = 0.0,
    yaw_rate: float = 0.0,
    *,
    frame: int = 1,
    to: tuple[int, int] = (11, 1),
) -> SetpointLocal:
    return SetpointLocal(PILOT, 0, *to, frame, mask, position, velocity, acceleration, yaw, yaw_rate)


class Rig:
    def __init__(
        self,
        flavour: str = "ardupilot",
        *,
        tick: int = 5_000,
        signing: Signing | None = None,
        saved: Saved | None = None,
        **settings: Any,
    ) -> None:
        place = {"latitude": SITE.latitude, "longitude": SITE.longitude, "altitude": SITE.altitude}
        self.flavour = flavour
        self.config = AutopilotConfig(**{"system_id": 11, "flavour": flavour, **place, **settings})
        self.autopilot = Autopilot(self.config, FIREFLY, SITE, seed=1, saved=saved, signing=signing)
        self.now = 0
        self.tick = tick
        self.most = 1
        """Greatest number of datagrams of a step: one, but in a download."""
        self.received: list[tuple[int, Message]] = []
        self.bytes = b""
        self._codec = Codec()
        self._sender = Codec()

    def step(self, *messages: Message) -> None:
        data = b"".join(map(self._sender.encode, messages))
        self.step_bytes(data)

    def step_bytes(self, data: bytes, link: str = LINK) -> None:
        out = self.autopilot.step(self.now, [Datagram(link, data)] if data else [])
        assert len(out) <= self.most
        for datagram in out:
            self.bytes += datagram.data
            self.received += [(self.now, message) for message in self._codec.feed(datagram.data)]
        self.now += self.tick

    def run(self, seconds: float, *every: Message, hz: float = 50.0) -> None:
        """Let time pass, sending ``every`` at ``hz``."""
        pause = max(1, round(1e6 / hz / self.tick))
        for k in range(round(seconds * 1e6 / self.tick)):
            self.step(*(every if k % pause == 0 else ()))

    def order(self, command: int, *params: float, to: tuple[int, int] = (11, 1)) -> list[int]:
        """The results that come back for a command."""
        seen = len(self.received)
        values = (*map(float, params), *([0.0] * 7))[:7]
        self.step(CommandLong(PILOT, *to, command, 0, values))
        return [
            m.result for _, m in self.received[seen:] if isinstance(m, CommandAck) and m.command == command
        ]

    def all(self, kind: type[M]) -> list[M]:
        return [m for _, m in self.received if isinstance(m, kind)]

    @property
    def texts(self) -> list[str]:
        return [m.text for m in self.all(StatusText)]

    @property
    def position(self) -> Any:
        return self.autopilot.state.position

    @property
    def speed(self) -> float:
        return float(np.linalg.norm(self.autopilot.state.velocity))

    def guided(self) -> list[int]:
        return self.order(SET_MODE, *GUIDED[self.flavour])

    def hover(self, height: float = 5.0) -> Rig:
        """Armed, at rest at ``height``, in GUIDED or, for PX4, in HOLD."""
        self.run(self.config.ready_after + 0.1)
        if self.flavour == "ardupilot":
            assert self.guided() == [0]
            assert self.order(ARM, 1) == [0]
            assert self.order(TAKEOFF, 0, 0, 0, 0, 0, 0, height) == [0]
        else:
            assert self.order(ARM, 1) == [0]
            above_sea = math.nan if height == self.config.takeoff_height else self.config.altitude + height
            assert self.order(TAKEOFF, *[math.nan] * 6, above_sea) == [0]
        self.run(height / self.config.takeoff_speed + 5.0)
        return self

    def steer(self, seconds: float, message: SetpointLocal, hz: float = 50.0) -> None:
        """Stream a set-point, entering GUIDED with it."""
        self.step(message)
        assert self.guided() == [0]
        self.run(seconds, message, hz=hz)


def within(points: Iterable[Any], centre: Any, radius: float) -> bool:
    return all(np.linalg.norm(np.asarray(point) - centre) <= radius for point in points)
