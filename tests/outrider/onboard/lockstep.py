"""``outrider fly`` with its processes, and a vehicle of the SITL, by one clock that waits for the slowest.

Time is as fast as the machine allows, whatever else it does: a test by this clock cannot fail because the
machine is busy.
"""

from __future__ import annotations

import os
import random
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

import pytest
import yaml

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.messages import Heartbeat
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from outrider.resources import find
from outrider.sitl_server.request import Options, checked
from sitl.autopilot.saved import Saved
from sitl.node import LINK
from tests.outrider.onboard.process import HOST, Flying, Target, free_port
from tests.outrider.onboard.turns import Conductor

START: Final = 1_767_225_600_000_000
"""µs"""
STEP: Final = 10_000
"""µs of the vehicle's time."""
_ROOT: Final = Path(__file__).resolve().parents[3]


class Vehicle:
    """One of ``outrider sitl``, ``speed`` times as fast as the clock, at the far end of ``link``."""

    def __init__(self, flavour: str, speed: float, link: Link) -> None:
        self._node = checked(Options(flavour=flavour)).autopilot(0, START, Saved())
        self._link, self._codec = link, Codec()
        self._period = round(STEP / speed)
        self._time = 0
        self.due = START
        """µs of the clock, of its next step."""
        self.beats: list[Heartbeat] = []

    def step(self) -> None:
        """Go on by a step, and say what is due."""
        inbox = [Datagram(LINK, data) for data in self._link.receive()]
        for datagram in self._node.step(self._time, inbox):
            self._link.send(datagram.data)
            said = self._codec.feed(datagram.data, whole=True)
            self.beats += [message for message in said if isinstance(message, Heartbeat)]
        self._time += STEP
        self.due += self._period

    def mode(self) -> int | None:
        """The last that it said."""
        return self.beats[-1].custom_mode if self.beats else None


class InTurns(Flying):
    """``Flying`` by the clock of a ``conductor``, beside a ``vehicle``."""

    def __init__(self, directory: Path, conductor: Conductor, vehicle: Vehicle, *options: str) -> None:
        self._conductor, self._vehicle = conductor, vehicle
        with conductor.admit() as end:
            program = ("tests.outrider.onboard.in_turns", str(end.fileno()))
            super().__init__(directory, *options, program=program, hands=[end.fileno()])

    def now(self) -> float:
        """s of the clock."""
        return self._conductor.now * 1e-6

    def rest(self) -> None:
        """The turns up to the vehicle's next step, and this step."""
        conductor, vehicle = self._conductor, self._vehicle
        if conductor.alone:
            # The process is about to end, which takes no time of the clock.
            time.sleep(0.001)
            return
        while conductor.now < vehicle.due and not conductor.alone:
            conductor.advance(vehicle.due)
        vehicle.step()
        for pump in self.pump:
            pump()

    def until_vehicle(self, is_so: Callable[[], object], beats: int) -> None:
        """Go on without regard to the process, until the vehicle has said ``beats`` more at most."""
        most = len(self._vehicle.beats) + beats
        while not is_so():
            assert len(self._vehicle.beats) < most
            while self._conductor.now < self._vehicle.due:
                self._conductor.advance(self._vehicle.due)
            self._vehicle.step()


@contextmanager
def flight(
    tmp_path: Path, flavour: str, speed: float, *options: str, clock: str = "autopilot"
) -> Iterator[tuple[InTurns, Vehicle]]:
    """One vehicle of the SITL, its companion, and a target."""
    with ExitStack() as files:
        port, conductor = free_port(), Conductor(START)
        files.callback(conductor.close)
        group = f"mcast:239.255.{random.randrange(1, 250)}.{random.randrange(1, 250)}:{port},{HOST}"
        links = [open_link(place, SimulatedClock(START)) for place in (f"udpout:{HOST}:{port}", group)]
        for link in links:
            files.callback(link.close)
        document = yaml.safe_load(find("companions", flavour).read_text(encoding="utf-8"))
        (tmp_path / "own.yaml").write_text(yaml.safe_dump(document | {"system": 1, "clock": clock}))
        vehicle = Vehicle(flavour, speed, links[0])
        ends = f"--autopilot=udpin:{HOST}:{port}", f"--swarm={group}", f"--config={tmp_path / 'own.yaml'}"
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("PYTHONPATH", os.pathsep.join((str(_ROOT), os.environ.get("PYTHONPATH", ""))))
            flying = InTurns(tmp_path, conductor, vehicle, *ends, *options)
        flying.pump.append(Target(links[1], speed, flying.now).pump)
        try:
            yield flying, vehicle
        finally:
            if flying.process.poll() is None:
                flying.process.kill()
                # Its child ends with the conductor: it would wait for its turn, and keep the pipes open.
                conductor.close()
                flying.process.communicate()
