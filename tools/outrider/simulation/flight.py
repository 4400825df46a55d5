"""Lock-step flight of a scenario: its fleet under simulated time.

The conductor leads the flight, the truth observer records it, and the scenario's events are applied to it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from companion.obstacles.moving import MovingObstacles
from mavlink_bridge.loops.lockstep import StepObserver
from outrider.runs.ground_truth import GroundTruth, Limits
from outrider.runs.outcome import Messages, Outcome
from outrider.runs.surfaces import Surfaces
from outrider.scenarios.feasibility import check_drawn
from outrider.scenarios.scenario import Scenario
from outrider.scene.changes import Change
from outrider.simulation.conductor import Conductor, Observation, Stage
from outrider.simulation.fleet import Fleet
from outrider.simulation.swarm_range import swarm_range
from outrider.simulation.team import Instructions, Report, Results, Team, obey, results_of, schedule
from outrider.simulation.truth_observer import TruthObserver
from outrider.simulation.vehicles import EPOCH, Share, Vehicles, VehicleSnapshot
from sitl.vehicle.config import VehicleConfig

__all__ = ["EPOCH", "Flight", "Onlooker", "Progress", "truth_of"]

Progress = Callable[[Stage, float], None]
Onlooker = Callable[["Flight", int], None]
"""Function of flight and time (µs), called at every sample after all nodes have stepped."""


class Flight:
    """Flight of a scenario's nodes for one seed, in one or several ``processes``.

    ``progress`` is called with the stage and the simulated seconds since the goal event, or before it since
    the beginning. Each vehicle's tlog is written to the ``run_directory``, if there is one. ``stopwatch``
    (ns) measures planning. ``reverse_nodes`` reverses the order in which nodes step. The ``onlooker`` may
    read ``snapshots`` and ``change`` the flight. ``companions``, ``autopilots`` and ``backup_nodes`` are
    those of this process. The result does not depend on the number of processes, to the bit.
    """

    def __init__(
        self,
        scenario: Scenario,
        vehicle: VehicleConfig,
        seed: int,
        logs: Path,
        progress: Progress = lambda _stage, _seconds: None,
        reverse_nodes: bool = False,
        run_directory: Path | None = None,
        stopwatch: Callable[[], int] = time.thread_time_ns,
        onlooker: Onlooker | None = None,
        processes: int = 1,
    ) -> None:
        self.scenario, self.seed = scenario, seed
        self.fleet = fleet = Fleet(scenario, vehicle, seed, logs)
        check_drawn(scenario, seed, self.fleet.starts.positions)
        self.systems = fleet.systems
        self.target = fleet.target()
        self.moving = fleet.moving()
        self._team = Team(fleet, processes, stopwatch, run_directory, watched=onlooker is not None)
        share = Share(0, processes)
        self._vehicles = Vehicles(fleet, share, stopwatch, run_directory, self._team.exchange)
        self.autopilots = self._vehicles.autopilots
        self.companions = self._vehicles.companions
        self.backup_nodes = list(self._vehicles.backup_nodes.values())
        self.network = self._vehicles.network
        reach = scenario.links.swarm.range
        if reach is not None:
            self.network.limit("swarm", swarm_range(reach, self.autopilots, self.moving))
        self.operator = fleet.operator()
        self.truth = truth_of(scenario)
        self.conductor = Conductor(scenario, fleet.starts, self.operator, EPOCH)
        self._observer = TruthObserver(self.target, self.truth, self.moving)
        self._progress = progress
        self._reverse = reverse_nodes
        self._onlooker = onlooker
        self._changes: list[Change] = []
        self._reports: list[Report] = []
        self._others: list[Results] = []

    def run(self, taps: Sequence[StepObserver] = ()) -> None:
        """Fly to the end; ``outcome`` then holds the results. ``taps`` observe the steps of this process.

        Raises OutriderError if another process of the flight fails.
        """
        others = schedule(self.scenario, *self.fleet.shown(self.target, self.moving), self.operator)
        try:
            self._team.start()
            self._vehicles.run(others, self._watch, taps, reverse=self._reverse)
            self._others = self._team.results()
        finally:
            self._team.stop()

    @property
    def cpu_of_others(self) -> float:
        """CPU time (s) of the other processes of the flight that has ended."""
        return sum(one.cpu for one in self._others)

    @property
    def outcome(self) -> Outcome:
        """Results of the flight."""
        conductor = self.conductor
        parts = [results_of(self._vehicles, 0.0), *self._others]
        now = [tally for part in parts for tally in part.now]
        at_start = [tally for part in parts for tally in part.at_start] or now
        at_end = [tally for part in parts for tally in part.at_end] or now
        return Outcome(
            self.scenario,
            self.seed,
            self.fleet.vehicle.span,
            self.fleet.starts,
            self.target.system,
            self.truth,
            conductor.clock_start,
            conductor.clock_end,
            conductor.converged_at,
            conductor.others_converged_at,
            conductor.able_converged_at,
            conductor.covered,
            conductor.failure,
            list(zip(at_start, at_end, strict=True)),
            Messages(
                sum(part.counters.sent for part in parts),
                sum(part.counters.dropped for part in parts),
                sum(part.bad_frames for part in parts),
            ),
            plan_logs=[log for part in parts for log in part.plan_logs],
            motion=self.fleet.vehicle.motion,
        )

    def snapshots(self, now: int) -> list[VehicleSnapshot]:
        """Return the snapshots of all vehicles at ``now`` (µs), the time of the last sample."""
        others = [one for report in self._reports for one in report.snapshots]
        return self._vehicles.snapshots(now) + others

    def change(self, now: int, change: Change) -> None:
        """Apply ``change`` at ``now`` (µs), the time of the last sample."""
        self._changes.append(change)
        if change.target is not None:
            self.target.move(now, np.array(change.target))

    def _watch(self, now: int) -> bool:
        """Process a tick; return True to end the run."""
        own, conductor = self._vehicles.see(now), self.conductor
        if own is None:
            return False
        self._reports = self._team.reports()
        self._vehicles.synchronise()
        parts = [own, *(report.part for report in self._reports)]
        self._observer.take(now, [part.motions for part in parts])
        start = conductor.clock_start
        self._progress(conductor.stage, (now - (EPOCH if start is None else start)) * 1e-6)
        positions, velocities, target = self.truth.latest()
        waiting = tuple(text for part in parts for text in part.waiting)
        armed = any(part.armed for part in parts)
        over = conductor.see(Observation(now, positions, velocities, target, not waiting, waiting, armed))
        begins = start is None and conductor.clock_start is not None
        if begins:
            self.target.begin(now)
            for moving in self.moving:
                moving.begin(now)
        instructions = Instructions(begins, conductor.clock_end is not None, over)
        obey(self._vehicles, now, instructions)
        if self._onlooker is not None:
            self._onlooker(self, now)
            instructions = instructions._replace(changes=tuple(self._changes))
            for change in self._changes:
                self._vehicles.change(change)
            self._changes.clear()
        self._team.instruct(instructions)
        return over


def truth_of(scenario: Scenario) -> GroundTruth:
    """Return the collector of the true motions, with the scenario's distance limits and obstacles."""
    return GroundTruth(
        scenario.size,
        Limits(
            scenario.d_min,
            scenario.d_min_target,
            scenario.d_min_obstacle,
            scenario.companion.field.downwash,
        ),
        Surfaces(scenario.obstacles),
        MovingObstacles(scenario.moving_known),
    )
