"""Vehicles that one process of a lock-step flight steps: autopilots, companions and backup nodes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import NamedTuple

from companion.planning.avoidance import Tally
from companion.values.phase import Phase
from mavlink_bridge.loops.garbage import seldom_collected
from mavlink_bridge.loops.lockstep import LockStep, Scheduled, StepObserver
from mavlink_bridge.network.part import NetworkPart, Sent
from mavlink_bridge.node import Datagram, Node
from outrider.runs import names
from outrider.runs.ground_truth import Array
from outrider.runs.recorder import Recorder
from outrider.scenarios.faults import Vanish
from outrider.scenarios.links import PartitionPart
from outrider.scene.camera_view import NO_VIEW, Single
from outrider.scene.changes import Change
from outrider.scene.companion_snapshot import CompanionSnapshot, companion_snapshot
from outrider.scene.view_commands import LOSSY, ViewCommands
from outrider.simulation.disturbances import Event, events, strike_autopilot, strike_computer
from outrider.simulation.ending_companion import EndingCompanion
from outrider.simulation.fleet import Fleet
from outrider.simulation.sight import view_of
from outrider.simulation.system_clocks import step_clock
from outrider.simulation.truth_observer import MotionObserver, Motions

EPOCH = 1_767_225_600_000_000
"""Unix time (µs) of the beginning of every simulated flight: 2026-01-01 UTC, a date that log tools accept."""
_MAX_DURATION_US = 10_000_000_000
"""Upper bound of a flight (µs); the conductor ends every flight long before."""


class Share(NamedTuple):
    """Share of process ``number`` of ``processes`` in the vehicles; process 0 also steps all other nodes."""

    number: int = 0
    processes: int = 1

    def vehicles(self, size: int) -> list[int]:
        """Return the indices of the vehicles among ``size``: equal blocks in order."""
        return [k for k in range(size) if k * self.processes // size == self.number]


class Part(NamedTuple):
    """State of the vehicles of one process at a sample.

    ``waiting``: the conditions for which companions wait; ``armed``: whether a vehicle whose companion has
    not vanished is armed.
    """

    motions: Motions
    waiting: tuple[str, ...]
    armed: bool


class VehicleSnapshot(NamedTuple):
    """Snapshot of a vehicle: true position (3,), m, and attitude (4,), NED, and that of its companion.

    ``view``: row of its camera, see ``camera_view``.
    """

    position: Array
    attitude: Array
    companion: CompanionSnapshot
    view: Single = NO_VIEW


class Elsewhere:
    """Node of another process: it has a name and is never stepped."""

    def __init__(self, name: str) -> None:
        self.name = name

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Raise RuntimeError."""
        raise RuntimeError(f"{self.name} is stepped by another process")


class Vehicles:
    """Vehicles of one ``share`` of the ``fleet``, their part of the network, and their faults.

    ``stopwatch`` (ns) measures planning. Each vehicle's tlog is written to ``directory``, if there is one.
    ``exchange`` hands datagrams to the other processes, and returns theirs.
    """

    def __init__(
        self,
        fleet: Fleet,
        share: Share,
        stopwatch: Callable[[], int],
        directory: Path | None,
        exchange: Callable[[list[Sent]], list[Sent]] = lambda _sent: [],
    ) -> None:
        scenario = fleet.scenario
        self._fleet, self._scenario, self._directory = fleet, scenario, directory
        self._exchange = exchange
        self.indices = share.vehicles(scenario.size)
        self.systems = [fleet.systems[k] for k in self.indices]
        self.autopilots = [fleet.autopilot(k) for k in self.indices]
        self.backup_nodes = {k: fleet.backup_of(k) for k in self.indices if k in fleet.with_backup}
        self._nodes = [
            EndingCompanion(partial(fleet.companion, k, stopwatch, EPOCH), self.backup_nodes.get(k))
            for k in self.indices
        ]
        self.companions = [node.companion for node in self._nodes]
        nodes: list[Node] = [*self.autopilots, *self.companions, *self.backup_nodes.values()]
        own = {node.name for node in nodes}
        if share.number == 0:
            own |= {names.TARGET, names.OPERATOR, *map(names.moving, scenario.moving_systems)}
        self._own = own
        self.network = NetworkPart(fleet.channels(), fleet.seed, scenario.timing.base_tick_us, own)
        self._observer = MotionObserver(self.autopilots)
        self._events = deque(events(scenario))
        self._vanished: set[int] = set()
        self._start: int | None = None
        self.tally_at_start: list[Tally] = []
        self.tally_at_end: list[Tally] = []

    def run(
        self,
        others: Iterable[Scheduled],
        watch: Callable[[int], bool | None],
        taps: Sequence[StepObserver] = (),
        *,
        reverse: bool = False,
    ) -> None:
        """Step all nodes, and the ``others``, until ``watch`` (time, µs) returns True after a tick.

        ``taps`` observe the steps. ``reverse`` reverses the order in which nodes step.
        """
        nodes = [*self._schedule(), *others]
        elsewhere = {entry.node.name for entry in nodes} - self._own
        if not self._events:
            # Samples are at ticks of every process; only events need the ticks of nodes elsewhere, too.
            nodes = [entry for entry in nodes if entry.node.name in self._own]
        with ExitStack() as files, seldom_collected():
            if self._directory is not None:
                taps = [*taps, Recorder(self._directory, self.systems, files)]
            loop = LockStep(
                nodes[::-1] if reverse else nodes,
                self.network,
                self._scenario.timing.base_tick_us,
                taps,
                elsewhere=elsewhere,
            )
            computers = _Computers(loop, self.network, self)

            def watched(now: int) -> bool | None:
                self._strike_due(now, computers)
                return watch(now)

            loop.run(EPOCH + _MAX_DURATION_US, watched)

    def see(self, now: int) -> Part | None:
        """Return the state of the vehicles if a sample is due at ``now`` (µs).

        At every sample the processes have to ``synchronise``.
        """
        motions = self._observer.see(now)
        if motions is None:
            return None
        waiting = tuple(
            f"{c.name} waits for {c.pilot.waiting_for}"
            + (f" ({c.pilot.vehicle.said})" if c.pilot.vehicle.said else "")
            for c in self.companions
            if c.pilot.phase is not Phase.ESCORT
        )
        armed = any(
            a.armed for s, a in zip(self.systems, self.autopilots, strict=True) if s not in self._vanished
        )
        return Part(motions, waiting, armed)

    def synchronise(self) -> None:
        """Exchange datagrams with the other processes."""
        self.network.admit(self._exchange(self.network.outgoing()))

    def snapshots(self, now: int) -> list[VehicleSnapshot]:
        """Return the snapshots of the vehicles at ``now`` (µs), without a change of their states."""
        return [
            VehicleSnapshot(a.state.position, a.state.attitude, companion_snapshot(c, now), view_of(a))
            for a, c in zip(self.autopilots, self.companions, strict=True)
        ]

    def change(self, change: Change) -> None:
        """Apply the methods and the loss of ``change``."""
        if change.methods is not None:
            for k, companion in zip(self.indices, self.companions, strict=True):
                if k < self._scenario.vehicles:
                    companion.use(ViewCommands(methods=change.methods).method_names)
        if change.loss is not None:
            self.network.lose(LOSSY, change.loss)

    def begin(self, now: int) -> None:
        """Process the goal event: record the tallies, and inform the autopilots."""
        self._start = now
        self.tally_at_start = self.tallies
        for autopilot in self.autopilots:
            autopilot.begin(now)

    def end(self) -> None:
        """Record the tallies at the end of the flight's time."""
        if not self.tally_at_end:
            self.tally_at_end = self.tallies

    @property
    def tallies(self) -> list[Tally]:
        """Counters of the companions, with those that have ended."""
        return [node.tally for node in self._nodes]

    def node(self, system: int) -> EndingCompanion | None:
        """Return the node of the companion of ``system``; None if another process steps it."""
        return self._nodes[self.systems.index(system)] if system in self.systems else None

    def restart(self, system: int) -> None:
        """Replace the companion of ``system``, which has ended, by another one."""
        if system in self.systems:
            k = self.systems.index(system)
            self.companions[k] = self._nodes[k].restart()

    def _schedule(self) -> list[Scheduled]:
        """Return the schedule of all vehicles; each companion has its own phase and clock."""
        timing, fleet = self._scenario.timing, self._fleet
        autopilots = dict(zip(self.indices, self.autopilots, strict=True))
        companions = dict(zip(self.indices, self._nodes, strict=True))
        nodes = []
        for k, (system, phase) in enumerate(zip(fleet.systems, fleet.phases(), strict=True)):
            autopilot = autopilots.get(k) or Elsewhere(names.autopilot(system))
            companion = companions.get(k) or Elsewhere(names.companion(system))
            nodes.append(Scheduled(autopilot, timing.autopilot_us, EPOCH))
            nodes.append(Scheduled(companion, timing.companion_us, EPOCH + phase, fleet.clock(k, EPOCH)))
        for k in fleet.with_backup:
            backup_node = self.backup_nodes.get(k) or Elsewhere(names.backup_node(fleet.systems[k]))
            nodes.append(Scheduled(backup_node, timing.companion_us, EPOCH, fleet.clock(k, EPOCH)))
        return nodes

    def _strike_due(self, now: int, computers: _Computers) -> None:
        """Apply the events that are due at ``now`` (µs)."""
        if self._start is not None:
            while self._events and self._events[0].after <= now - self._start:
                self._strike(self._events.popleft(), computers)

    def _strike(self, event: Event, computers: _Computers) -> None:
        if isinstance(event.what, PartitionPart):
            # A datagram that was sent before a cut still arrives.
            self.synchronise()
        strike_computer(event, computers)
        if isinstance(event.what, PartitionPart):
            return
        if event.what.vehicle in self.systems:
            strike_autopilot(event, self.autopilots[self.systems.index(event.what.vehicle)])
        if isinstance(event.what, Vanish):
            self._vanished.add(event.what.vehicle)


class _Computers:
    """The companions' computers in lock-step."""

    def __init__(self, loop: LockStep, network: NetworkPart, vehicles: Vehicles) -> None:
        self._loop, self._network, self._vehicles = loop, network, vehicles

    def freeze(self, system: int) -> None:
        self._loop.freeze(names.companion(system))

    def thaw(self, system: int) -> None:
        self._loop.thaw(names.companion(system))

    def vanish(self, system: int) -> None:
        node = self._vehicles.node(system)
        if node is None or not node.has_backup:
            self._loop.vanish(names.companion(system))
        else:
            self.end(system)

    def end(self, system: int) -> None:
        node = self._vehicles.node(system)
        if node is not None:
            self._loop.thaw(names.companion(system))
            node.end()

    def restart(self, system: int) -> None:
        self._vehicles.restart(system)

    def step_clock(self, system: int, by: int) -> None:
        node = self._vehicles.node(system)
        if node is not None:
            step_clock(node.companion, by)

    def cut(self, systems: tuple[int, ...]) -> None:
        self._network.cut("swarm", map(names.companion, systems))

    def heal(self, systems: tuple[int, ...]) -> None:
        self._network.heal("swarm", map(names.companion, systems))
