"""One real-time flight of a scenario, with one process per node over UDP.

The parent process runs the operator and conducts the flight by the state on the board (``SharedPage``).
"""

from __future__ import annotations

import signal
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType

import numpy as np

from companion.planning.avoidance import Tally
from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.loops.histogram import Histogram
from mavlink_bridge.loops.lockstep import Scheduled
from mavlink_bridge.loops.realtime import RealTime
from outrider.errors import Fault, InputError, OutriderError
from outrider.realtime.processes import Processes
from outrider.realtime.shared_page import SharedPage
from outrider.realtime.spawn import operators_turn, rough, spawn
from outrider.realtime.traces import Moved, Trace, put_together
from outrider.realtime.view import RealTimeView, Seen
from outrider.realtime.view_page import Window
from outrider.realtime.wiring import wire
from outrider.realtime.workers import ProcessResults
from outrider.runs import names
from outrider.runs.ground_truth import SAMPLE, Array
from outrider.runs.outcome import Messages, Outcome, Punctuality
from outrider.scenarios.feasibility import check_drawn
from outrider.scenarios.scenario import Scenario
from outrider.simulation.conductor import PREPARE_CAP, Conductor, Observation, Stage
from outrider.simulation.disturbances import Event, events, strike_computer
from outrider.simulation.fleet import Fleet
from outrider.simulation.flight import Progress, truth_of
from sitl.vehicle.config import VehicleConfig

_START, _START_WITH_PRIORITY = 1_000_000, 3_000_000
"""µs between forking and the first step.

It is longer with priority, because a real-time process delays the start of the others.
"""
_NO_TALLY = Tally(0, 0, 0, 0, 0, ())


class RealTimeFlight:
    """Real-time flight of the nodes of ``scenario``, each in a forked process.

    The tlogs are written to ``directory``. With ``priority`` every node requests real-time priority;
    ``priority_told`` then reports the result.

    ``run`` may be called once, from the main thread. It handles SIGINT and SIGTERM: the first signal lands
    the fleet, the second ends the flight at once.
    """

    def __init__(
        self,
        scenario: Scenario,
        vehicle: VehicleConfig,
        seed: int,
        logs: Path,
        directory: Path,
        progress: Progress = lambda _stage, _seconds: None,
        *,
        priority: bool = False,
        view: RealTimeView | None = None,
    ) -> None:
        if scenario.links.swarm.range is not None:
            what = "needs the true places of all vehicles at once; allowed in real time: null"
            raise InputError(Fault("links.swarm.range", what))
        self.scenario, self.seed = scenario, seed
        self.fleet = Fleet(scenario, vehicle, seed, logs)
        check_drawn(scenario, seed, self.fleet.starts.positions)
        self.priority_told = ""
        self.outcome: Outcome
        self._directory = directory
        self._progress = progress
        self._priority = priority
        self._view = view
        self._clock = WallClock()
        self._interrupts = 0

    def run(self) -> None:
        """Fly to the end; ``outcome`` then holds the results.

        Raises OutriderError if a process failed or an autopilot left no trace, LinkError if a link cannot be
        opened.
        """
        # The physics is compiled here, before forking, so that not every process compiles it.
        first = self.fleet.autopilot(0)
        for now in (0, self.fleet.vehicle.physics_period):
            first.step(now, [])
        window = None if self._view is None else Window(self.scenario.size)
        board = SharedPage(self.scenario.size, window)
        wiring = wire(
            self.scenario.size,
            self._clock,
            len(self.scenario.moving),
            len(self.fleet.with_backup),
            cameras=self.fleet.has_cameras,
        )
        with TemporaryDirectory() as folder, self._interruptible():
            scratch = Path(folder)
            start = self._clock.now() + (_START_WITH_PRIORITY if self._priority else _START)
            workers = spawn(self.fleet, wiring, self._clock, board, start, self._directory, scratch)
            children = Processes(workers, wiring, board, scratch)
            children.start_all(priority=self._priority)
            try:
                wiring.close_others(wiring.operator)
                operator = self.fleet.operator()
                behind = rough(self.fleet, operator, {"ground": None})
                conductor = Conductor(self.scenario, self.fleet.starts, operator, start)
                leader = _Leader(self.fleet, conductor, children, board, self._progress, self._view)
                every = Scheduled(
                    behind, self.scenario.timing.companion_us, operators_turn(self.fleet, start)
                )
                loop = RealTime(every, wiring.operator, self._clock)
                loop.run(lambda: self._interrupts > 1, lambda now: leader.look(now, self._interrupts > 0))
            finally:
                remains = children.results()
            counters = behind.network.counters
            self.outcome = self._gather(
                scratch, conductor, leader.moves, remains, Messages(counters.sent, counters.dropped, 0)
            )

    @contextmanager
    def _interruptible(self) -> Iterator[None]:
        """Count SIGINT and SIGTERM instead of ending by them."""

        def count(_signal: int, _frame: FrameType | None) -> None:
            self._interrupts += 1

        before = {which: signal.signal(which, count) for which in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for which, handler in before.items():
                signal.signal(which, handler)

    def _gather(
        self,
        scratch: Path,
        conductor: Conductor,
        moves: Sequence[tuple[int, Array]],
        remains: Mapping[str, ProcessResults],
        operators: Messages,
    ) -> Outcome:
        scenario, systems = self.scenario, self.fleet.systems
        faults = [f"{name}: {found.error}" for name, found in remains.items() if found.error]
        if faults:
            raise OutriderError("; ".join(faults))
        traces = [path for path in (scratch / f"trace-{system}" for system in systems) if path.exists()]
        if len(traces) < scenario.size:
            raise OutriderError(_nothing(conductor, "an autopilot's process was killed"))
        found_traces = [Trace.load(path) for path in traces]
        if not all(len(trace.times) for trace in found_traces):
            raise OutriderError(_nothing(conductor, "an autopilot never began"))
        truth = truth_of(scenario)
        period, fleet = self.fleet.vehicle.physics_period, self.fleet
        target = Moved(fleet.target(), moves)
        put_together(found_traces, period, target, fleet.moving(), conductor.clock_start, truth)
        self.priority_told = next((found.priority for found in remains.values() if found.priority), "")
        companions = [remains[names.companion(system)] for system in systems]
        return Outcome(
            scenario,
            self.seed,
            self.fleet.vehicle.span,
            self.fleet.starts,
            self.fleet.target_system,
            truth,
            conductor.clock_start,
            conductor.clock_end,
            conductor.converged_at,
            conductor.others_converged_at,
            conductor.able_converged_at,
            conductor.covered,
            conductor.failure,
            [found.tallies or (_NO_TALLY, _NO_TALLY) for found in companions],
            Messages(
                operators.sent + sum(found.sent for found in remains.values()),
                operators.dropped + sum(found.dropped for found in remains.values()),
                sum(found.bad for found in companions),
            ),
            _punctuality(companions),
            [found.plan_log for found in companions],
            self.fleet.vehicle.motion,
        )


class _Leader:
    """Observer of the board for the conductor; it also freezes, resumes and ends companions."""

    def __init__(
        self,
        fleet: Fleet,
        conductor: Conductor,
        children: Processes,
        board: SharedPage,
        progress: Progress,
        view: RealTimeView | None = None,
    ) -> None:
        self._fleet, self._conductor, self._processes, self._board = fleet, conductor, children, board
        self._progress = progress
        self._view = view
        self.moves: list[tuple[int, Array]] = []
        """Times (µs) and places (3,) of the moves of the target by hand."""
        self._events: deque[Event] = deque(events(fleet.scenario))
        self._target = fleet.target()
        self._moving = fleet.moving()
        self._began: int | None = None
        self._looked = 0

    def look(self, now: int, interrupted: bool) -> bool:
        """Observe the fleet after the operator's step, at most once per ``SAMPLE``; return True to end."""
        if now - self._looked < SAMPLE:
            return False
        self._looked = now
        self._began = now if self._began is None else self._began
        conductor, board = self._conductor, self._board
        start = conductor.clock_start
        while start is not None and self._events and self._events[0].after <= now - start:
            strike_computer(self._events.popleft(), self)
        self._check(now, interrupted)
        positions, velocities = board.positions, board.velocities
        if np.isnan(positions).any():
            return self._blind(now)
        self._progress(conductor.stage, 1e-6 * (now - (self._began if start is None else start)))
        waiting = tuple(
            f"{names.companion(system)} waits for {board.waiting(k)}"
            for k, system in enumerate(self._fleet.systems)
            if not board.ready[k] and not board.gone[k]
        )
        armed = bool((board.armed & (board.gone == 0)).any())
        place = self._target.position(now)
        over = conductor.see(Observation(now, positions, velocities, place, not waiting, waiting, armed))
        if start is None and conductor.clock_start is not None:
            board.goal = now
            self._target.begin(now)
            for moving in self._moving:
                moving.begin(now)
        if conductor.clock_end is not None and not board.end:
            board.end = conductor.clock_end
        if self._view is not None and board.window is not None:
            self._show(now, place, self._view, board.window)
        return over

    def _show(self, now: int, place: Array | None, view: RealTimeView, window: Window) -> None:
        """Send a snapshot to the view, and apply the view's commands."""
        conductor, board = self._conductor, self._board
        start = conductor.clock_start
        seconds = None if start is None else 1e-6 * (now - start)
        since = 1e-6 * (now - (self._began or now)) if seconds is None else seconds
        moving = [one.motion(now).position for one in self._moving]
        view.show(now, Seen(since, conductor.stage.value, board.positions, place, moving), window)
        for change in view.changes(seconds):
            window.command(change)
            if change.target is not None:
                self._target.move(now, np.array(change.target))
                self.moves.append((now, np.array(change.target)))

    def _blind(self, now: int) -> bool:
        """Wait for missing positions; return True to end the run, after ``PREPARE_CAP`` or an abort."""
        unseen = np.isnan(self._board.positions).any(axis=1)
        if now - (self._began or now) > PREPARE_CAP:
            systems = [str(self._fleet.systems[k]) for k in np.flatnonzero(unseen)]
            self._conductor.abort(now, f"vehicles never seen: {', '.join(systems)}")
        return self._conductor.stage is not Stage.PREPARE

    def _check(self, now: int, interrupted: bool) -> None:
        """Land all vehicles after an interruption, or if a process has ended that was not to vanish."""
        conductor, board = self._conductor, self._board
        if interrupted and conductor.stage in (Stage.PREPARE, Stage.CLOCK):
            conductor.abort(now, "interrupted: all vehicles were told to land")
        for name, status in self._processes.ended().items():
            kind, _, system = name.rpartition("-")
            if kind == "companion":
                k = self._fleet.systems.index(int(system))
                if board.gone[k]:
                    continue
                # Its vehicle can no longer be ordered to land.
                board.gone[k] = 1
            conductor.abort(now, f"the process of {name} ended with status {status}")

    # Faults of companions' computers; each companion's process applies partitions, steps of its clock, and
    # restarts.

    def freeze(self, system: int) -> None:
        self._processes.freeze(names.companion(system))

    def thaw(self, system: int) -> None:
        # Written while the process is stopped, so that its next step reads it.
        self._board.thaws[self._fleet.systems.index(system)] += 1
        self._processes.thaw(names.companion(system))

    def vanish(self, system: int) -> None:
        self._board.gone[self._fleet.systems.index(system)] = 1

    def end(self, system: int) -> None:
        pass

    def restart(self, system: int) -> None:
        pass

    def step_clock(self, system: int, by: int) -> None:
        pass

    def cut(self, systems: tuple[int, ...]) -> None:
        pass

    def heal(self, systems: tuple[int, ...]) -> None:
        pass


def _nothing(conductor: Conductor, why: str) -> str:
    """Return the reason why there is no outcome."""
    said = f"{conductor.failure}; " if conductor.failure else ""
    return f"{said}{why}: its vehicle's true motion was not recorded"


def _punctuality(companions: Collection[ProcessResults]) -> Punctuality:
    lateness = Histogram()
    for found in companions:
        lateness.include(found.lateness)
    p50, p99, largest = (1e-3 * value for value in lateness.spread)
    misses, deadlines = (sum(getattr(found, of) for found in companions) for of in ("misses", "deadlines"))
    return Punctuality(misses, deadlines, p50, p99, largest)
