"""What can be read from a finished flight: its logs, its true samples, who was heard by whom, who arrived."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest

from mavlink_bridge.messages import Message
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.runs.ground_truth import Samples
from outrider.runs.names import LINK_NUMBERS
from outrider.simulation.conductor import SLOW, Stage
from tests.scenarios.lockstep_flights import Flown


class Heard(NamedTuple):
    """A message of a log: seconds after the goal event, the link, the message."""

    time: float
    link: int
    message: Message


def log(flown: Flown, system: int) -> Iterator[Heard]:
    """What the companion of ``system`` received and sent, by its own clock."""
    start = flown.flight.conductor.clock_start
    assert start is not None
    codec = Codec()
    for record in read_tlog(flown.directory / f"vehicle-{system}.tlog"):
        for message in codec.feed(record.frame):
            yield Heard((record.time - start) * 1e-6, record.link, message)


def spoke(flown: Flown, listener: int, since: float = -60.0, until: float = 3600.0) -> set[int]:
    """Whom ``listener`` hears on the swarm link in a time (s after the goal event)."""
    received = {
        h.message.source.system
        for h in log(flown, listener)
        if h.link == LINK_NUMBERS["swarm"] and since < h.time < until
    }
    return received - {listener}


def clock(flown: Flown) -> tuple[Samples, np.ndarray]:
    """The samples of the clock, and their times (T,) in s after the goal event."""
    start = flown.flight.conductor.clock_start
    assert start is not None
    samples = flown.flight.truth.samples(start)
    return samples, (samples.time - start) * 1e-6


def arrived(flown: Flown) -> list[bool]:
    """Of each vehicle, whether it truly rests at its goal in the end, as near as its sensors can tell."""
    samples, _ = clock(flown)
    goals = flown.flight.fleet.starts.goals
    assert goals is not None
    near = np.linalg.norm(samples.position[-1] - goals, axis=1) < flown.flight.conductor.near
    slow = np.linalg.norm(samples.velocity[-1], axis=1) < SLOW
    return [bool(there) for there in near & slow]


def figure(flown: Flown, key: str, which: str) -> float:
    """One of several figures under a key of the summary."""
    several = flown.summary[key]
    assert isinstance(several, dict)
    value = several[which]
    assert value is not None
    return float(value)


def check_told(flown: Flown) -> None:
    """What holds for every flight that begins and ends in the air, whatever happens in it: nothing is NaN or
    ∞, the plans are within the limits, and the figures agree with the truth."""
    flight, summary = flown.flight, flown.summary
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    assert flight.conductor.failure is None
    assert flown.watch.stages == [Stage.PREPARE, Stage.CLOCK]
    assert flight.conductor.stage is Stage.DONE
    assert flown.watch.plans_finite
    assert flown.watch.planned_acceleration <= flight.scenario.companion.limits.a_total + 1e-9
    assert summary["solver_failures"] == 0
    assert figure(flown, "messages", "bad") == 0
    assert flight.operator.unanswered == []
    samples, _ = clock(flown)
    for part in (samples.position, samples.velocity, samples.acceleration, samples.yaw, samples.tilt):
        assert np.isfinite(part).all()
    truth = flight.truth
    if flight.scenario.vehicles > 1:
        assert summary["min_separation_m"] == pytest.approx(truth.vehicles.minimum, abs=1e-4)
    assert (truth.vehicles.count > 0) == (truth.vehicles.minimum < flight.scenario.d_min)
    near = truth.vehicles.count + truth.target.count + truth.obstacles.count
    assert summary["d_min_violations"] == near
