"""A vehicle with a camera on the bench, hovering, and what its camera says."""

from __future__ import annotations

from typing import Any, TypeVar

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandLong, HilState, Message, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from sitl.camera.occlusion import Body, Ground
from sitl.camera.scene import LINK as SIGHT
from sitl.camera.scene import Scene
from sitl.config.autopilot import AutopilotConfig
from sitl.node import LINK, Autopilot
from sitl.values.camera import CameraConfig
from tests.sitl.autopilot_rig import FIREFLY, PILOT, SITE

TARGET, OTHER = 10, 12
TICK = 10_000
M = TypeVar("M", bound=Message)


class Bench:
    """A vehicle that hovers 5 m above the origin and looks north; the target is at ``target`` (ENU)."""

    def __init__(
        self,
        *,
        seed: int = 1,
        sensors: str = "truth",
        bodies: tuple[Body, ...] = (),
        moving: dict[int, Body] | None = None,
        target: tuple[float, float, float] | None = (0.0, 8.0, 0.0),
        start: int = 0,
        site: FleetFrame = SITE,
        **camera: Any,
    ) -> None:
        place = {"latitude": site.latitude, "longitude": site.longitude, "altitude": site.altitude}
        config = AutopilotConfig(system_id=11, start_height=5.0, sensors=sensors, **place)
        self.config = CameraConfig(**camera)
        vehicle = FIREFLY.model_copy(update={"camera": self.config})
        scene = Scene(TARGET, (Ground(0.05), *bodies), moving or {})
        self.autopilot = Autopilot(config, vehicle, site, seed, scene=scene)
        self.site = site
        self.target = target
        self.now = start
        self.received: list[tuple[int, Message]] = []
        self.datagrams: list[Datagram] = []
        self._codec, self._sender = Codec(), Codec()

    def truth(self, place: tuple[float, float, float], system: int = TARGET) -> Datagram:
        where = self.site.to_geodetic(place)
        state = HilState(Source(system, 1), self.now, *where, (0.0, 0.0, 0.0))
        return Datagram(SIGHT, self._sender.encode(state))

    def step(self, *messages: Message, inbox: tuple[Datagram, ...] = ()) -> None:
        arrived = [Datagram(LINK, self._sender.encode(message)) for message in messages]
        if self.target is not None:
            arrived.append(self.truth(self.target))
        out = self.autopilot.step(self.now, [*arrived, *inbox])
        for datagram in out:
            if datagram.link == LINK:
                self.datagrams.append(datagram)
                self.received += [(self.now, message) for message in self._codec.feed(datagram.data)]
        self.now += TICK

    def run(self, seconds: float) -> None:
        for _ in range(round(1e6 * seconds / TICK)):
            self.step()

    def order(self, command: int, *params: float, to: tuple[int, int] = (11, 100)) -> list[Message]:
        """What comes back in the step of a command."""
        seen = len(self.received)
        values = (*map(float, params), *([0.0] * 7))[:7]
        self.step(CommandLong(PILOT, *to, command, 0, values))
        return [message for _, message in self.received[seen:]]

    def all(self, kind: type[M]) -> list[M]:
        return [message for _, message in self.received if isinstance(message, kind)]

    def times(self, kind: type[Message]) -> list[int]:
        return [time for time, message in self.received if isinstance(message, kind)]
