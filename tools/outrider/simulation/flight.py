"""Lock-step flight of a scenario: its fleet under simulated time.

The conductor leads the flight, the truth observer records it, and the scenario's events are applied to it.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from companion.obstacles.moving import MovingObstacles
from companion.obstacles.static import FixedObstacles
from companion.planning.avoidance import Tally
from companion.values.phase import Phase
from mavlink_bridge.loops.garbage import seldom_collected
from mavlink_bridge.loops.lockstep import LockStep, Scheduled
from mavlink_bridge.network.simulated import SimulatedNetwork
from outrider.runs import names
from outrider.runs.ground_truth import GroundTruth, Limits
from outrider.runs.outcome import Messages, Outcome
from outrider.runs.recorder import Recorder
from outrider.scenarios.faults import Vanish
from outrider.scenarios.links import PartitionPart
from outrider.scenarios.scenario import Scenario
from outrider.simulation.conductor import Conductor, Observation, Stage
from outrider.simulation.disturbances import Event, events, strike_autopilot, strike_computer
from outrider.simulation.fleet import Fleet
from outrider.simulation.truth_observer import TruthObserver
from sitl.vehicle.config import VehicleConfig

EPOCH = 1_767_225_600_000_000
"""Unix time (µs) of the beginning of every simulated flight: 2026-01-01 UTC, a date that log tools accept."""
_MAX_DURATION_US = 10_000_000_000
"""Upper bound of a flight (µs); the conductor ends every flight long before."""

Progress = Callable[[Stage, float], None]
Onlooker = Callable[["Flight", int], None]
"""Function of flight and time (µs), called at every sample after all nodes have stepped."""


class Flight:
    """Flight of a scenario's nodes for one seed.

    ``progress`` is called with the stage and the simulated seconds since the goal event, or before it since
    the beginning. Each vehicle's tlog is written to the ``run_directory``, if there is one. ``stopwatch``
    (ns) measures planning. ``reverse_nodes`` reverses the order in which nodes step. The ``onlooker`` may
    change the nodes and the network.
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
    ) -> None:
        self.scenario, self.seed = scenario, seed
        self.fleet = fleet = Fleet(scenario, vehicle, seed, logs)
        self.systems = fleet.systems
        self.target = fleet.target()
        self.moving = fleet.moving()
        self.autopilots = [fleet.autopilot(k) for k in range(scenario.size)]
        self.companions = [fleet.companion(k, stopwatch) for k in range(scenario.size)]
        self.backup_nodes = [fleet.backup_of(k) for k in fleet.with_backup]
        self.operator = fleet.operator()
        self.truth = truth_of(scenario)
        self.network = SimulatedNetwork(fleet.channels(), seed, scenario.timing.base_tick_us)
        self.conductor = Conductor(scenario, fleet.starts, self.operator, EPOCH)
        self._observer = TruthObserver(self.autopilots, self.target, self.truth, self.moving)
        self._progress = progress
        self._reverse = reverse_nodes
        self._directory = run_directory
        self._onlooker = onlooker
        self._events = deque(events(scenario))
        self._vanished: set[int] = set()
        self._tally_at_start: list[Tally] = []
        self._tally_at_end: list[Tally] = []

    def run(self) -> None:
        """Fly to the end; ``outcome`` then holds the results."""
        with ExitStack() as files, seldom_collected():
            taps = []
            if self._directory is not None:
                taps.append(Recorder(self._directory, self.systems, files))
            loop = LockStep(self._schedule(), self.network, self.scenario.timing.base_tick_us, taps)
            computers = _Computers(loop, self.network)
            loop.run(EPOCH + _MAX_DURATION_US, lambda now: self._watch(now, computers))

    @property
    def outcome(self) -> Outcome:
        """Results of the flight."""
        conductor, now = self.conductor, [c.tally for c in self.companions]
        counters = self.network.counters
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
            conductor.failure,
            list(zip(self._tally_at_start or now, self._tally_at_end or now, strict=True)),
            Messages(counters.sent, counters.dropped, sum(c.bad_frames for c in self.companions)),
            plan_logs=[c.plan_log for c in self.companions],
        )

    def _schedule(self) -> list[Scheduled]:
        """Return the schedule; each companion has its own phase and clock."""
        timing = self.scenario.timing
        nodes = [Scheduled(a, timing.autopilot_us, EPOCH) for a in self.autopilots]
        for k, (companion, phase) in enumerate(zip(self.companions, self.fleet.phases(), strict=True)):
            clock = self.fleet.clock(k, EPOCH)
            nodes.append(Scheduled(companion, timing.companion_us, EPOCH + phase, clock))
        for k in self.fleet.with_backup:
            clock = self.fleet.clock(k, EPOCH)
            nodes.append(Scheduled(self.backup_nodes[k], timing.companion_us, EPOCH, clock))
        nodes.append(Scheduled(self.target, timing.companion_us, EPOCH))
        nodes += [Scheduled(moving, timing.companion_us, EPOCH) for moving in self.moving]
        nodes.append(Scheduled(self.operator, timing.companion_us, EPOCH))
        return nodes[::-1] if self._reverse else nodes

    def _watch(self, now: int, computers: _Computers) -> bool:
        """Process a tick; return True to end the run."""
        conductor = self.conductor
        if conductor.clock_start is not None:
            while self._events and self._events[0].after <= now - conductor.clock_start:
                self._strike(self._events.popleft(), computers)
        if not self._observer.see(now):
            return False
        start = conductor.clock_start
        self._progress(conductor.stage, (now - (EPOCH if start is None else start)) * 1e-6)
        over = conductor.see(self._sight(now))
        if start is None and conductor.clock_start is not None:
            self._begin(now)
        if conductor.clock_end is not None and not self._tally_at_end:
            self._tally_at_end = [c.tally for c in self.companions]
        if self._onlooker is not None:
            self._onlooker(self, now)
        return over

    def _begin(self, now: int) -> None:
        """Process the goal event: record the tallies, and inform target, moving obstacles and autopilots."""
        self._tally_at_start = [c.tally for c in self.companions]
        self.target.begin(now)
        for moving in self.moving:
            moving.begin(now)
        for autopilot in self.autopilots:
            autopilot.begin(now)

    def _sight(self, now: int) -> Observation:
        positions, velocities, target = self.truth.latest()
        waiting = [
            f"{c.name} waits for {c.pilot.waiting_for}" + (f" ({c.pilot.said})" if c.pilot.said else "")
            for c in self.companions
            if c.pilot.phase is not Phase.ESCORT
        ]
        armed = any(
            a.armed for s, a in zip(self.systems, self.autopilots, strict=True) if s not in self._vanished
        )
        return Observation(now, positions, velocities, target, not waiting, tuple(waiting), armed)

    def _strike(self, event: Event, computers: _Computers) -> None:
        strike_computer(event, computers)
        if isinstance(event.what, PartitionPart):
            return
        strike_autopilot(event, self.autopilots[self.systems.index(event.what.vehicle)])
        if isinstance(event.what, Vanish):
            self._vanished.add(event.what.vehicle)


class _Computers:
    """The companions' computers in lock-step."""

    def __init__(self, loop: LockStep, network: SimulatedNetwork) -> None:
        self._loop, self._network = loop, network

    def freeze(self, system: int) -> None:
        self._loop.freeze(names.companion(system))

    def thaw(self, system: int) -> None:
        self._loop.thaw(names.companion(system))

    def vanish(self, system: int) -> None:
        self._loop.vanish(names.companion(system))

    def cut(self, systems: tuple[int, ...]) -> None:
        self._network.cut("swarm", map(names.companion, systems))

    def heal(self, systems: tuple[int, ...]) -> None:
        self._network.heal("swarm", map(names.companion, systems))


def truth_of(scenario: Scenario) -> GroundTruth:
    """Return the collector of the true motions, with the scenario's distance limits and obstacles."""
    return GroundTruth(
        scenario.size,
        Limits(scenario.d_min, scenario.d_min_target, scenario.d_min_obstacle),
        FixedObstacles(scenario.obstacles),
        MovingObstacles(scenario.moving_known),
    )
