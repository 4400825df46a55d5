"""Cost of an additional vehicle in lock-step: time of a plan, real-time factor on one core, memory.

``python -m benchmarks.scale [--far] [--seconds S] [VEHICLES…]``, by default 2 to 200 vehicles. Each swarm has
a process of its own, starts in the air and flies for S seconds (10): ``antipodal``, in which all paths cross
in the middle, or ``--far``, in which neighbours on the ring are 100 m apart and messages of none of them
affect a plan.
"""

from __future__ import annotations

import resource
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np

from outrider.resources import config_root, find
from outrider.scenarios.changes import merged
from outrider.scenarios.scenario import Scenario
from outrider.simulation.flight import Flight
from outrider.terminal.share_progress import share_progress
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig

VEHICLES = (2, 8, 16, 32, 64, 128, 200)
_REPLAN_US = 50_000
_NEAR, _FAR = 4.0, 100.0
"""Distance (m) between neighbours on the ring."""
_SECONDS = 10.0


class Cost(NamedTuple):
    """Cost of one swarm.

    It has the median plan (CPU ms), simulated seconds per CPU second, CPU ms of one vehicle in a simulated
    second, the largest memory (MiB), and the share of the neighbours' messages that were decoded.
    """

    vehicles: int
    plan_ms: float
    real_time: float
    vehicle_ms: float
    memory: int
    received: float


class _EnoughError(Exception):
    """The flight has lasted long enough."""


def fly(vehicles: int, apart: float, seconds: float) -> Cost:
    """Fly one swarm for ``seconds``, in a process that does nothing else, and return its cost."""
    box = max(200.0, apart * vehicles)
    changes = {
        "vehicles": vehicles,
        "airborne": True,
        "starts": {"apart": apart},
        "companion": {
            "rates": {"replan_us": _REPLAN_US},
            "limits": {"box_min": [-box, -box, 3.0], "box_max": [box, box, 10.0]},
        },
    }
    document = merged(load(find("scenarios", "antipodal"), Scenario).model_dump(), changes)
    first: list[tuple[int, float]] = []

    def look(_flight: Flight, now: int) -> None:
        # Everything is compiled and loaded by then.
        if not first:
            first.append((now, time.process_time()))
        elif now - first[0][0] >= 1e6 * seconds:
            raise _EnoughError

    vehicle = load(find("vehicles", "firefly"), VehicleConfig)
    flight = Flight(Scenario.model_validate(document), vehicle, 1, config_root() / "logs", onlooker=look)
    with suppress(_EnoughError):
        flight.run()
    spent = time.process_time() - first[0][1]
    plans = np.concatenate([np.asarray(companion.tally.plan_ns) for companion in flight.companions])
    links = [companion.counters["swarm"] for companion in flight.companions]
    good, filtered = sum(link.good for link in links), sum(link.filtered for link in links)
    # One heartbeat per second is filtered in any case.
    beats = seconds * vehicles * (vehicles - 1)
    return Cost(
        vehicles,
        1e-6 * float(np.median(plans)),
        seconds / spent,
        1e3 * spent / seconds / vehicles,
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
        good / max(good + filtered - beats, 1.0),
    )


def main() -> None:
    """Fly the swarms one after another and print their cost."""
    words = sys.argv[1:]
    apart = _FAR if "--far" in words else _NEAR
    seconds = float(words[words.index("--seconds") + 1]) if "--seconds" in words else _SECONDS
    numbers = [word for k, word in enumerate(words) if word.isdigit() and words[k - 1] != "--seconds"]
    counts = [int(number) for number in numbers] or list(VEHICLES)
    costs = []
    with (
        share_progress() as progress,
        ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as pool,
    ):
        # The work grows with the square where all receive all.
        done, whole = 0.0, float(sum(count * (40 + count) for count in counts))
        for count in counts:
            progress(f"{count} vehicles", done / whole)
            costs.append(pool.submit(fly, count, apart, seconds).result())
            done += count * (40 + count)
    sys.stdout.write(
        "| vehicles | plan p50, ms | × real time | CPU ms per vehicle and second | memory, MiB | heard |\n"
        "|---|---|---|---|---|---|\n"
    )
    for cost in costs:
        sys.stdout.write(
            f"| {cost.vehicles} | {cost.plan_ms:.2f} | {cost.real_time:.2f} | {cost.vehicle_ms:.0f} "
            f"| {cost.memory} | {100.0 * cost.received:.0f} % |\n"
        )


if __name__ == "__main__":
    main()
