"""Process of a node: runs it under the wall clock over its links until the run ends.

It also writes the node's state to the board (``SharedPage``), and the results for the summary to a file.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from collections import deque
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from companion.avoidance.field.plan_log import PlanLog
from companion.planning.avoidance import Tally
from companion.values.phase import Phase
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.links.link import Link
from mavlink_bridge.loops.garbage import IdleCollector
from mavlink_bridge.loops.histogram import Histogram
from mavlink_bridge.loops.lockstep import Scheduled, StepObserver
from mavlink_bridge.loops.priority import LEVEL, ask_for_priority, sharpen_timers
from mavlink_bridge.loops.realtime import RealTime
from outrider.realtime.impaired_link import ImpairedLink
from outrider.realtime.shared_page import SharedPage
from outrider.realtime.traces import TraceWriter
from outrider.realtime.view_page import EVERY, Window
from outrider.runs import names
from outrider.runs.recorder import Recorder
from outrider.scene.companion_snapshot import companion_snapshot
from outrider.scene.view_commands import LOSSY
from outrider.simulation.bystander import Bystander
from outrider.simulation.disturbances import Event, strike_autopilot, strike_computer
from outrider.simulation.ending_companion import EndingCompanion
from outrider.simulation.moving import MovingObstacle
from outrider.simulation.sight import view_of
from outrider.simulation.system_clocks import step_clock
from outrider.simulation.targets import Target
from sitl.node import Autopilot

TOLERANCE = 1_000
"""Lateness (µs) above which a deadline is missed: a tenth of a companion's usual period."""


@dataclass
class ProcessResults:
    """Results of one process.

    ``deadlines``: number of deadlines from the first step to the last; ``misses``: number of those without a
    step within ``TOLERANCE``.
    """

    deadlines: int = 0
    misses: int = 0
    lateness: Histogram = field(default_factory=Histogram)
    sent: int = 0
    dropped: int = 0
    bad: int = 0
    tallies: tuple[Tally, Tally] | None = None
    plan_log: PlanLog = field(default_factory=PlanLog)
    priority: str = ""
    error: str = ""


class NodeEnvironment(NamedTuple):
    """Environment of a node: its impaired links, schedule, open links, clock and board."""

    rough: ImpairedLink
    scheduled: Scheduled
    links: dict[str, list[Link]]
    clock: Clock
    board: SharedPage


class Worker:
    """One node in its own process, with ``events`` that are applied after the goal event."""

    above = 0
    """Real-time priority, in levels above that of the other workers."""

    def __init__(self, slot: NodeEnvironment, events: Iterable[Event] = ()) -> None:
        self.rough, self._scheduled, self.links, self._clock, self.board = slot
        self.remains = ProcessResults()
        self._parent = os.getpid()
        self._events = deque(events)
        self._goal_seen = False
        self._taps: list[StepObserver] = []

    def over(self) -> bool:
        """Return whether to end: the parent requested it, or has ended itself."""
        return self.board.stop or os.getppid() != self._parent

    def excused(self) -> bool:
        """Return whether the scenario stopped the process since the last call; then misses do not count."""
        return False

    def begin(self, now: int) -> None:
        """Process the goal event, at ``now`` µs."""

    def strike(self, event: Event) -> None:
        """Apply an event to the node."""

    def show(self, now: int) -> None:
        """Write the node's state to the board after a step."""

    def leave(self, path: Path) -> None:
        """Write the results to ``path``; called at the end, also after an error."""
        path.write_bytes(pickle.dumps(self.remains))

    def main(self, directory: Path, priority: bool) -> None:
        """Run the process from fork to exit; exit status 0, or 3 after an exception."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        if priority:
            self.remains.priority = ask_for_priority(LEVEL + self.above).told
        else:
            sharpen_timers()
        status = 0
        try:
            self._run()
        except Exception as error:
            # The parent reports the error: this process has no console of its own.
            self.remains.error = f"{type(error).__name__}: {error}"
            status = 3
        self.leave(directory / self.rough.name)
        sys.exit(status)

    def taps(self, files: ExitStack) -> list[StepObserver]:
        """Return the observers of the datagrams; they are closed with ``files``."""
        return []

    def _run(self) -> None:
        with IdleCollector() as garbage, ExitStack() as files:
            self._taps = self.taps(files)
            loop = RealTime(
                self._scheduled,
                self.links,
                self._clock,
                tolerance=TOLERANCE,
                on_idle=garbage.idle,
                excused=self.excused,
            )
            try:
                statistics = loop.run(self.over, self._stepped)
            finally:
                # The input on which a node fails is logged.
                self.rough.show(self._taps)
                due = loop.deadlines
                self.remains.lateness = due.lateness
                self.remains.deadlines = due.lateness.count + due.skipped
                self.remains.misses = due.misses + due.skipped
        counters = self.rough.network.counters
        self.remains.sent = counters.sent
        self.remains.dropped = counters.dropped + statistics.overruns

    def _stepped(self, now: int) -> None:
        # This is called after the step's output is sent, so that writing a log delays no set-point.
        self.rough.show(self._taps)
        goal = self.board.goal
        if goal and not self._goal_seen:
            self._goal_seen = True
            self.begin(goal)
        while goal and self._events and self._events[0].after <= now - goal:
            self.strike(self._events.popleft())
        self.show(now)


class AutopilotWorker(Worker):
    """An autopilot with its vehicle; it has a higher priority because it is due more often."""

    above = 1

    def __init__(
        self, k: int, node: Autopilot, trace: Path, slot: NodeEnvironment, events: Iterable[Event]
    ) -> None:
        super().__init__(slot, events)
        self._k, self._node = k, node
        self._trace = TraceWriter(node)
        self._trace_path = trace

    def begin(self, now: int) -> None:
        """Pass the goal event to the autopilot."""
        self._node.begin(now)

    def strike(self, event: Event) -> None:
        """Apply an event to the autopilot."""
        strike_autopilot(event, self._node)

    def show(self, now: int) -> None:
        """Record the trace, and write each sample to the board."""
        sample = self._trace.see(now)
        if sample is not None:
            self.board.show_vehicle(self._k, sample[0:3], sample[3:6], self._node.armed)
            if self.board.window is not None:
                self.board.window.show_attitude(self._k, self._node.state.attitude)
                self.board.window.show_view(self._k, view_of(self._node))

    def leave(self, path: Path) -> None:
        """Write the trace and the results."""
        self._trace.save(self._trace_path)
        super().leave(path)


class CompanionWorker(Worker):
    """A companion; it writes its vehicle's tlog to ``logs``."""

    def __init__(
        self,
        k: int,
        node: EndingCompanion,
        system: int,
        logs: Path,
        slot: NodeEnvironment,
        events: Iterable[Event],
    ) -> None:
        super().__init__(slot, events)
        self._k, self._node = k, node
        self._system, self._logs = system, logs
        self._thaws = 0
        self._next_glimpse = self._commands = 0
        self._shown: tuple[bool, str] | None = None
        self._first: Tally | None = None
        self._last: Tally | None = None

    def over(self) -> bool:
        """Return whether to end; also true if this companion shall vanish."""
        return bool(self.board.gone[self._k]) or super().over()

    def excused(self) -> bool:
        """Return whether the companion was frozen and resumed since the last call."""
        before, self._thaws = self._thaws, int(self.board.thaws[self._k])
        return self._thaws != before

    def begin(self, now: int) -> None:
        """Record the tally at the goal event."""
        self._first = self._node.tally

    def strike(self, event: Event) -> None:
        """Apply a partition to the companion's links, a step to its system clock, or a restart to it."""
        strike_computer(event, _OwnComputer(self.rough, self._node))

    def show(self, now: int) -> None:
        """Write the companion's state to the board and, if there is one, to the view."""
        if self.board.end and self._last is None:
            self._last = self._node.tally
        pilot = self._node.companion.pilot
        said = pilot.vehicle.said
        shown = pilot.phase is Phase.ESCORT, pilot.waiting_for + (f" ({said})" if said else "")
        if shown != self._shown:
            self._shown = shown
            self.board.show_companion(self._k, *shown)
        if self.board.window is not None and now >= self._next_glimpse:
            self._next_glimpse = now + EVERY
            self._update_view(now, self.board.window)

    def _update_view(self, now: int, window: Window) -> None:
        """Write the node's snapshot for the view, and apply the view's commands."""
        window.show_companion(self._k, companion_snapshot(self._node.companion, now))
        if window.commands == self._commands:
            return
        self._commands = window.commands
        companion = self._node.companion
        if window.methods and not isinstance(companion, Bystander):
            companion.use(window.methods)
        if window.loss is not None:
            self.rough.network.lose(LOSSY, window.loss)

    def leave(self, path: Path) -> None:
        """Write the results, with tallies and plan log."""
        now = self._node.tally
        self.remains.tallies = (self._first or now, self._last or now)
        self.remains.bad = self._node.companion.bad_frames
        self.remains.plan_log = self._node.companion.plan_log
        super().leave(path)

    def taps(self, files: ExitStack) -> list[StepObserver]:
        """Return the recorder of the vehicle's tlog."""
        return [Recorder(self._logs, [self._system], files)]


class PlayedWorker(Worker):
    """A simulated node that is neither autopilot nor companion: the target, or a moving obstacle."""

    def __init__(self, node: Target | MovingObstacle, slot: NodeEnvironment) -> None:
        super().__init__(slot)
        self._node = node
        self._moves = 0

    def begin(self, now: int) -> None:
        """Start the node at the goal event."""
        self._node.begin(now)

    def show(self, now: int) -> None:
        """Move the target as the view commands."""
        window = self.board.window
        if window is not None and window.moves != self._moves and not isinstance(self._node, MovingObstacle):
            self._moves = window.moves
            self._node.move(now, window.place)


class _OwnComputer:
    """Partitions of the swarm, steps of the system clock, and restarts, for one companion.

    The parent applies freezes and losses of processes.
    """

    def __init__(self, rough: ImpairedLink, companion: EndingCompanion) -> None:
        self._rough, self._companion = rough, companion

    def freeze(self, system: int) -> None:
        """Do nothing: the parent stops the process."""

    def thaw(self, system: int) -> None:
        """Do nothing: the parent resumes the process."""

    def vanish(self, system: int) -> None:
        """Do nothing: the process ends by ``SharedPage.gone``."""

    def end(self, system: int) -> None:
        self._companion.end()

    def restart(self, system: int) -> None:
        self._companion.restart()

    def step_clock(self, system: int, by: int) -> None:
        step_clock(self._companion.companion, by)

    def cut(self, systems: tuple[int, ...]) -> None:
        self._rough.cut(map(names.companion, systems))

    def heal(self, systems: tuple[int, ...]) -> None:
        self._rough.heal(map(names.companion, systems))
