"""Whole flights in lock-step, and what holds for every one of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from companion.values.phase import Phase
from mavlink_bridge.messages import SetpointLocal
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.resources import config_root, find
from outrider.runs.summary import Cost, Value, summarise
from outrider.scenarios.changes import merged
from outrider.scenarios.scenario import Scenario
from outrider.simulation.conductor import Stage
from outrider.simulation.flight import Flight
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig

FIREFLY = load(find("vehicles", "firefly"), VehicleConfig)
SLOWLY = {"companion": {"rates": {"replan_us": 50_000}}}
"""Replanning at 20 Hz: a fifth of the work."""
SINGLE = 1e-5
"""m/s²: what is lost of an acceleration in the float32 of a set-point."""


def scenario(name: str, *changes: dict[str, Any]) -> Scenario:
    """A shipped scenario that replans slowly, with ``changes`` merged in, checked again."""
    document = load(find("scenarios", name), Scenario).model_dump()
    for change in (SLOWLY, *changes):
        document = merged(document, change)
    return Scenario.model_validate(document)


@dataclass
class Watch:
    """Looks on at every sample: the plans that are flown, from take-off to landing."""

    flight: Flight | None = None
    stages: list[Stage] = field(default_factory=list)
    planned_acceleration: float = 0.0
    plans_finite: bool = True

    def __call__(self, stage: Stage, _seconds: float) -> None:
        if self.flight is None:
            return
        if stage not in self.stages:
            self.stages.append(stage)
        for companion in self.flight.companions:
            if companion.flown is not None:
                accelerations = companion.flown.knots[:, 6:9]
                self.plans_finite &= bool(np.isfinite(companion.flown.knots).all())
                largest = float(np.sqrt((accelerations**2).sum(axis=1).max()))
                self.planned_acceleration = max(self.planned_acceleration, largest)


@dataclass(frozen=True)
class Flown:
    """A finished flight, with the logs of its vehicles in ``directory``."""

    flight: Flight
    summary: dict[str, Value]
    watch: Watch
    directory: Path

    @property
    def logs(self) -> list[Path]:
        return [self.directory / f"vehicle-{system}.tlog" for system in self.flight.systems]


def fly(of: Scenario, seed: int, directory: Path, *, reverse_nodes: bool = False) -> Flown:
    directory.mkdir(parents=True, exist_ok=True)
    watch = Watch()
    flight = Flight(
        of,
        FIREFLY,
        seed,
        config_root() / "logs",
        progress=watch,
        reverse_nodes=reverse_nodes,
        run_directory=directory,
    )
    watch.flight = flight
    flight.run()
    return Flown(flight, summarise(flight.outcome, Cost(1.0, 1.0), directory), watch, directory)


def setpoints(log: Path) -> list[SetpointLocal]:
    """Every SET_POSITION_TARGET_LOCAL_NED of a vehicle's log."""
    codec = Codec(lambda identifier, _system, _component: identifier == 84)
    messages = [message for record in read_tlog(log) for message in codec.feed(record.frame)]
    return [message for message in messages if isinstance(message, SetpointLocal)]


def check(flown: Flown) -> None:
    """What holds for every flight: nobody too near, nothing beyond the limits, all down at the end."""
    flight, summary = flown.flight, flown.summary
    of = flight.scenario
    assert flight.conductor.failure is None
    assert flight.conductor.stage is Stage.DONE
    assert flown.watch.stages == [Stage.PREPARE, Stage.CLOCK, Stage.LAND]
    _check_separation(flown)
    assert summary["solver_failures"] == 0
    messages = summary["messages"]
    assert isinstance(messages, dict)
    assert messages["bad"] == 0
    assert not any(autopilot.armed or autopilot.airborne for autopilot in flight.autopilots)
    assert flight.operator.unanswered == []
    assert {companion.pilot.phase for companion in flight.companions} <= {Phase.LAND, Phase.DONE}
    assert flown.watch.plans_finite
    # ‖u + f‖ ≤ a_total, of every plan that was flown.
    assert flown.watch.planned_acceleration <= of.companion.limits.a_total + 1e-9
    _check_setpoints(flown)
    _check_motion(flown)


def _check_separation(flown: Flown) -> None:
    of, summary, truth = flown.flight.scenario, flown.summary, flown.flight.truth
    assert summary["d_min_violations"] == 0
    assert truth.vehicles.minimum >= of.d_min
    if of.vehicles > 1:
        assert truth.vehicles.minimum < 100.0
        assert np.nanmin(truth.samples().separation) == truth.vehicles.minimum
    if of.d_min_target is not None:
        assert of.d_min_target <= truth.target.minimum < 100.0


def _check_setpoints(flown: Flown) -> None:
    limits = flown.flight.scenario.companion.limits
    for system, log in zip(flown.flight.systems, flown.logs, strict=True):
        sent = setpoints(log)
        assert len(sent) > 50
        assert {(m.source.system, m.target_system, m.frame) for m in sent} == {(system, system, 1)}
        assert np.isfinite([[m.yaw, m.yaw_rate, *m.position] for m in sent]).all()
        accelerations = np.array([m.acceleration for m in sent])
        assert np.linalg.norm(accelerations, axis=1).max() <= limits.a_total + SINGLE
        velocities = np.abs([m.velocity for m in sent])
        # Limits of the state may give way to those of the acceleration, but not by much.
        assert (velocities <= 1.1 * np.array(limits.v_max)[[1, 0, 2]]).all()


def _check_motion(flown: Flown) -> None:
    limits = flown.flight.scenario.companion.limits
    samples = flown.flight.truth.samples()
    for part in (samples.position, samples.velocity, samples.acceleration, samples.yaw, samples.tilt):
        assert np.isfinite(part).all()
    assert (np.abs(samples.velocity) <= 1.2 * np.array(limits.v_max)).all()
    assert np.degrees(samples.tilt.max()) < 60.0
    low, high = np.array(limits.box_min), np.array(limits.box_max)
    assert (samples.position[..., :2] >= low[:2] - 1.0).all()
    assert (samples.position <= high + 1.0).all()
    # Down on the ground, not in it.
    assert np.abs(samples.position[-1, :, 2]).max() < 0.1
