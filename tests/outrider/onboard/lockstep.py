"""``outrider fly`` with its processes, and a vehicle of the SITL, by one clock that waits for the slowest.

The clock goes on when all processes wait, whatever else the machine does. So a test by this clock does not
fail because the machine is busy, with two exceptions, both of minutes of wall time: a process that neither
waits nor ends (``turns``), and one that has closed its socket and does not end (``process.ROUNDS``).
"""

from __future__ import annotations

import os
import random
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

import pytest
import yaml

from mavlink_bridge.clocks.clock import SimulatedClock
from mavlink_bridge.links.opening import open_link
from outrider.resources import find
from tests.outrider.onboard.far_ends import START, Target, Vehicle
from tests.outrider.onboard.process import HOST, Flying, free_port
from tests.outrider.onboard.turns import Conductor

_ROOT: Final = Path(__file__).resolve().parents[3]


@contextmanager
def flight(
    tmp_path: Path, flavour: str, speed: float, *options: str, clock: str = "autopilot"
) -> Iterator[tuple[Flying, Vehicle]]:
    """Provide one vehicle of the SITL, its companion, and a target."""
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
            flying = Flying(tmp_path, conductor, vehicle, *ends, *options)
        flying.pump.append(Target(links[1], speed, flying.now).pump)
        try:
            yield flying, vehicle
        finally:
            if flying.process.poll() is None:
                flying.process.kill()
                # Without the conductor its child would wait for a turn, and keep the pipes open.
                conductor.close()
                flying.process.communicate()
