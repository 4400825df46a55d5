"""Ten simulated minutes in one go, over lossy links, in wind, with noisy sensors and clocks that drift:
nothing grows, and the last minutes are flown as well as the first."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest

from outrider.resources import config_root
from outrider.runs.summary import Cost, summarise
from outrider.scenarios.scenario import Scenario
from outrider.simulation.conductor import Stage
from outrider.simulation.flight import Flight
from tests.scenarios.lockstep_flights import FIREFLY, scenario

LEG_S, LEGS = 20.0, 29
PLACES = ([6.0, 0.0, 0.0], [6.0, 6.0, 0.0], [0.0, 6.0, 0.0], [0.0, 0.0, 0.0])
MINUTE = 60.0
STOPWATCH = 36
"""Bytes that a companion keeps of every plan: one reading of its stopwatch."""
_SHARED = (type, ModuleType, FunctionType, BuiltinFunctionType, str, bytes)


class Weighed(NamedTuple):
    """What the nodes of a flight held after so many seconds, and how many plans there were until then."""

    seconds: float
    held: int
    plans: int


def parts(root: object) -> Iterator[object]:
    """Everything that ``root`` holds and nobody else made: no code, no text."""
    waiting, seen = [root], {id(root)}
    while waiting:
        one = waiting.pop()
        yield one
        for part in gc.get_referents(one):
            if id(part) not in seen and not isinstance(part, _SHARED):
                seen.add(id(part))
                waiting.append(part)


def weigh(flight: Flight, seconds: float) -> Weighed:
    """All but the truth, which is what a flight is for."""
    nodes: list[Any] = [
        *flight.companions,
        *flight.autopilots,
        flight.target,
        flight.operator,
        flight.network,
    ]
    held = sum(sys.getsizeof(part) for part in parts(nodes))
    return Weighed(seconds, held, sum(companion.tally.plans for companion in flight.companions))


def long_scenario() -> Scenario:
    jumps = [{"after_s": LEG_S * leg, "to": PLACES[leg % 4]} for leg in range(LEGS)]
    return scenario(
        "antipodal-8",
        {
            "task": "escort",
            "vehicles": 4,
            "cap_s": 620.0,
            "target": {"kind": "fixed", "at": [0.0, 0.0, 0.0], "jumps": jumps},
            "companion": {"task": "escort"},
            "sensors": "rtk",
            "weather": {"wind": [2.0, 1.0, 0.0]},
            "links": {"swarm": {"loss": 0.1}, "target": {"loss": 0.1}},
            "clocks": {"drift_ppm": 50.0},
        },
    )


@pytest.mark.soak
def test_ten_minutes_in_lock_step() -> None:
    weighed: list[Weighed] = []
    flights: list[Flight] = []

    def watch(stage: Stage, seconds: float) -> None:
        if stage is Stage.CLOCK and seconds >= MINUTE * (len(weighed) + 1):
            weighed.append(weigh(flights[0], seconds))

    of = long_scenario()
    flight = Flight(of, FIREFLY, 1, config_root() / "logs", progress=watch)
    flights.append(flight)
    flight.run()
    outcome = flight.outcome
    summary = summarise(outcome, Cost(1.0, 1.0), None)
    assert outcome.failure is None
    assert summary["converged"]
    assert summary["d_min_violations"] == summary["solver_failures"] == 0
    assert outcome.clock_start is not None

    # Nothing grows.
    first, last = weighed[1], weighed[-1]
    assert last.seconds - first.seconds > 6 * MINUTE
    grown = last.held - first.held - STOPWATCH * (last.plans - first.plans)
    assert grown < 0.05 * first.held, weighed

    # Nothing drifts: every leg ends as the first one did.
    samples = outcome.truth.samples(outcome.clock_start, outcome.clock_end)
    seconds = (samples.time - outcome.clock_start) * 1e-6
    tracking = np.linalg.norm(samples.position + samples.estimate_error - samples.reference, axis=-1)
    surface = of.companion.surface
    offset = samples.position - samples.target[:, None]
    radial = np.hypot(offset[..., 0], offset[..., 1]) - surface.radius
    standoff = np.hypot(radial, offset[..., 2] - surface.height)
    ends = []
    for leg in range(1, LEGS):
        settled = (seconds >= LEG_S * leg - 2.0) & (seconds < LEG_S * leg)
        ends.append((standoff[settled].max(), np.percentile(tracking[settled], 95)))
    off, tracked = np.array(ends).T
    # Now and then two are in each other's way when the target jumps again.
    assert (off < 0.3).mean() > 0.8
    assert np.median(off[-7:]) < 1.3 * np.median(off[:7]) + 0.02
    assert np.median(tracked[-7:]) < 1.3 * np.median(tracked[:7]) + 0.005
