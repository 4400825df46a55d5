"""Small flights, and pictures of them without a browser."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from outrider.scenarios.scenario import Scenario
from outrider.scene.datagram_channel import ROOM, DatagramChannel, pair
from outrider.scene.snapshot import Snapshot
from outrider.simulation.flight import Flight
from outrider.swarm.lockstep_view import LockStepView
from tests.outrider.shipped import FIREFLY, LOGS, scenario

SMALL: dict[str, Any] = {
    "vehicles": 3,
    "airborne": True,
    "cap_s": 3.0,
    "companion": {"rates": {"replan_us": 50_000}},
    "starts": {
        "kind": "points",
        "at": [[-3.0, 0.0, 5.0], [3.0, 0.0, 5.0], [0.0, 3.0, 5.0]],
        "goals": [[3.0, 0.0, 5.0], [-3.0, 0.5, 5.0], [0.0, -3.0, 5.0]],
    },
    "task": "goto",
}


def small(**changes: Any) -> Scenario:
    """Three vehicles that cross, for three seconds."""
    return scenario("antipodal-8", **{**SMALL, **changes})


def flown(of: Scenario, directory: Path, view: LockStepView | None) -> Flight:
    """With its logs in ``directory``."""
    directory.mkdir(parents=True, exist_ok=True)
    flight = Flight(of, FIREFLY, 3, LOGS, run_directory=directory, stopwatch=lambda: 0, onlooker=view)
    flight.run()
    return flight


def logs(directory: Path) -> dict[str, bytes]:
    """All bytes that a flight left."""
    return {path.name: path.read_bytes() for path in sorted(directory.iterdir())}


@contextmanager
def line(room: int = ROOM) -> Iterator[tuple[DatagramChannel, DatagramChannel]]:
    """Both ends."""
    ours, theirs = (DatagramChannel(end, room) for end in pair())
    yield ours, theirs
    ours.close()
    theirs.close()


def moments(end: DatagramChannel) -> list[Snapshot]:
    """What has come."""
    return [pickle.loads(data) for data in end.receive()]
