"""One companion on one emulated autopilot, step by step, in bytes; the companion may be replaced by the next
one, as by another ``outrider fly``."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from typing import Any, TypeVar

import numpy as np

from companion.config import CompanionConfig
from companion.node import Companion
from companion.values.components import COMPONENT
from companion.values.phase import Phase
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import (
    CommandLong,
    LocalPosition,
    Message,
    ParamRequestRead,
    Source,
    StatusText,
    Timesync,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from sitl.config.autopilot import AutopilotConfig
from sitl.node import Autopilot
from tests.scenarios.lockstep_flights import FIREFLY

SITE = FleetFrame(47.397742, 8.545594, 488.0)
SYSTEM, TARGET, TICK = 11, 100, 10_000
BOOT = 1_767_225_600_000_000
OPERATOR = Source(255, 190)
TAKEOFF, LAND, RETURN, MODE = 22, 21, 20, 176
SETTINGS: dict[str, Any] = {
    "task": "goto",
    "rates": {"replan_us": 100_000},
    "ground_messages": {"texts": True},
}

M = TypeVar("M", bound=Message)


class SingleVehicle:
    """``heard``: what the autopilot said, ``sent``: what the companion did, with its time (µs) and link.
    ``pace``: how much time (µs) has passed for the vehicle when so much has for the companion."""

    def __init__(
        self,
        flavour: str,
        settings: dict[str, Any] | None = None,
        pace: Callable[[int], int] = lambda passed: passed,
        **vehicle: Any,
    ) -> None:
        place = {"latitude": SITE.latitude, "longitude": SITE.longitude, "altitude": SITE.altitude}
        config = AutopilotConfig(**{"system_id": SYSTEM, "flavour": flavour, **place, **vehicle})
        self.autopilot = Autopilot(config, FIREFLY, SITE, seed=1)
        self.config = CompanionConfig.model_validate({**SETTINGS, **(settings or {})})
        self.now, self._pace = BOOT, pace
        self.received: list[tuple[int, Message]] = []
        self.sent: list[tuple[int, str, Message]] = []
        self._codec, self._reader, self._writer = Codec(), Codec(), Codec()
        self.timeless = False
        """Whether no question for the time reaches the autopilot."""
        self.secretive = False
        """Whether no request for a parameter reaches the autopilot."""
        self.mute = False
        """Whether nothing that it says of its place reaches the companion."""
        self.besides: list[Datagram] = []
        """What else reaches the companion at its next step."""
        self.companion = self._companion()
        self._down: list[Datagram] = []

    def _companion(self) -> Companion:
        stopwatch = count()
        return Companion(self.config, SYSTEM, TARGET, SITE, lambda: next(stopwatch))

    def replace_companion(self) -> None:
        """Another process begins, which knows nothing."""
        self.companion, self._down = self._companion(), []

    @property
    def phase(self) -> Phase:
        return self.companion.pilot.phase

    @property
    def place(self) -> np.ndarray:
        """Where it truly is, (3,) m ENU."""
        north, east, down = self.autopilot.state.position
        return np.array([east, north, -down])

    @property
    def texts(self) -> list[str]:
        """What the companion told the ground."""
        return [m.text for _, link, m in self.sent if link == "ground" and isinstance(m, StatusText)]

    def step(self, *orders: Message) -> None:
        up = [datagram for datagram in self._down if datagram.link == "autopilot"]
        if self.timeless:
            up = [Datagram(link, self._without(Timesync, data)) for link, data in up]
        if self.secretive:
            up = [Datagram(link, self._without(ParamRequestRead, data)) for link, data in up]
        inbox = self.autopilot.step(BOOT + self._pace(self.now - BOOT), up)
        for datagram in inbox:
            self.received += [(self.now, message) for message in self._codec.feed(datagram.data)]
        if self.mute:
            inbox = [Datagram(link, self._without(LocalPosition, data)) for link, data in inbox]
        if orders:
            inbox = [*inbox, Datagram("ground", b"".join(map(self._writer.encode, orders)))]
        self._down = self.companion.step(self.now, [*inbox, *self.besides])
        self.besides = []
        for link, data in self._down:
            self.sent += [(self.now, link, message) for message in self._codec.feed(data)]
        self.now += TICK

    def _without(self, kind: type[Message], data: bytes) -> bytes:
        messages = [message for message in self._reader.feed(data) if not isinstance(message, kind)]
        return b"".join(map(self._writer.encode, messages))

    def order(self, command: int, *params: float) -> None:
        """COMMAND_LONG to the companion, from the ground."""
        values: Any = (*map(float, params), *[0.0] * 7)[:7]
        self.step(CommandLong(OPERATOR, SYSTEM, COMPONENT, command, 0, values))

    def command(self, command: int, *params: float) -> None:
        """COMMAND_LONG to the autopilot, from a ground station."""
        values: Any = (*map(float, params), *[0.0] * 7)[:7]
        self.tell(CommandLong(OPERATOR, SYSTEM, 1, command, 0, values))

    def tell(self, message: Message) -> None:
        """To the autopilot, from a ground station."""
        self._down.append(Datagram("autopilot", self._writer.encode(message)))
        self.step()

    def run(self, seconds: float) -> SingleVehicle:
        for _ in range(round(seconds * 1e6 / TICK)):
            self.step()
        return self

    def until(self, phase: Phase, seconds: float = 40.0) -> SingleVehicle:
        for _ in range(round(seconds * 1e6 / TICK)):
            if self.phase is phase:
                return self
            self.step()
        raise AssertionError(f"{self.phase} after {seconds} s: {self.companion.pilot.waiting_for}")

    def waits_for(self, what: str, seconds: float = 10.0) -> SingleVehicle:
        for _ in range(round(seconds * 1e6 / TICK)):
            if self.companion.pilot.waiting_for == what:
                return self
            self.step()
        raise AssertionError(f"it waits for {self.companion.pilot.waiting_for}")

    def fly(self, height: float = 5.0) -> SingleVehicle:
        """From ready to the escort."""
        self.waits_for("the operator's go").order(TAKEOFF, 0, 0, 0, 0, 0, 0, height)
        return self.until(Phase.ESCORT)

    def all(self, kind: type[M]) -> list[M]:
        return [message for _, message in self.received if isinstance(message, kind)]
