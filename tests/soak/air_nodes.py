"""The nodes of an airfield. A ``RestartableCompanion`` is where a companion runs, and may be started anew; a
``Radio`` is what its autopilot says and hears by, and may change both; the ``Wanderer`` is the target, the
``Tower`` the operator."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.node import Companion
from companion.values.components import COMPONENT
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandLong, Message, SetpointLocal, Source, StatusText
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from outrider.resources import find
from outrider.runs import names
from outrider.simulation.beacon import Beacon
from outrider.simulation.paths import Motion
from outrider.yaml_files.yaml_file import load
from sitl.node import Autopilot
from sitl.vehicle.config import VehicleConfig

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


class RestartableCompanion:
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
        self.received: list[tuple[int, int, str]] = []
        """Time (µs), system, words."""

    def order(self, system: int, command: int, *params: float) -> None:
        """A COMMAND_LONG to the companion of a vehicle."""
        one, two, three, four, five, six, seven = (*params, *[0.0] * 7)[:7]
        self._orders.append(
            CommandLong(GROUND, system, COMPONENT, command, 0, (one, two, three, four, five, six, seven))
        )

    def go(self, system: int) -> None:
        """Up, or on."""
        self.order(system, mavlink.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, NAN, NAN, NAN, HEIGHT)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        for datagram in inbox:
            for message in self._reader.feed(datagram.data, whole=True):
                if isinstance(message, StatusText):
                    self.received.append((now, message.source.system, message.text))
        if self._signing is not None:
            self._signing.present(now)
        data = b"".join(map(self._writer.encode, self._orders))
        self._orders.clear()
        return [Datagram("ground", data)] if data else []
