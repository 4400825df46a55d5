"""Processes that fly the vehicles of one lock-step flight together.

The first process leads: it has the conductor, the ground truth, the target and the operator. At every sample
each process sends its part to the leader and gets its instructions, so between two samples no process needs
anything of another: every datagram between them takes longer than that.
"""

from __future__ import annotations

import signal
import time
import traceback
from collections.abc import Callable, Iterable
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from companion.avoidance.field.plan_log import PlanLog
from companion.planning.avoidance import Tally
from mavlink_bridge.loops.lockstep import Scheduled
from mavlink_bridge.network.part import Sent, least_delay
from mavlink_bridge.network.simulated import NetworkCounters
from outrider.errors import Fault, InputError, OutriderError
from outrider.processes.children import Children
from outrider.runs import names
from outrider.runs.ground_truth import SAMPLE
from outrider.scenarios.scenario import Scenario
from outrider.scene.changes import Change
from outrider.simulation.fleet import Fleet
from outrider.simulation.vehicles import EPOCH, Elsewhere, Part, Share, Vehicles, VehicleSnapshot

_END_S = 5.0
"""Time (s) that the other processes have to end."""


class Report(NamedTuple):
    """The part of a process, and the snapshots of its vehicles if somebody watches the flight."""

    part: Part
    snapshots: list[VehicleSnapshot]


class Instructions(NamedTuple):
    """Instructions of the leader after a sample.

    ``begin``: the goal event is now; ``ended``: the time of the flight has ended; ``over``: the flight is
    over; ``changes``: by hand.
    """

    begin: bool
    ended: bool
    over: bool
    changes: tuple[Change, ...] = ()


class Results(NamedTuple):
    """Results of the vehicles of one process; ``cpu``: CPU time (s) of the process."""

    at_start: list[Tally]
    at_end: list[Tally]
    now: list[Tally]
    plan_logs: list[PlanLog]
    counters: NetworkCounters
    bad_frames: int
    cpu: float


def results_of(vehicles: Vehicles, cpu: float) -> Results:
    """Return the results of ``vehicles``; ``cpu``: CPU time (s) of their process."""
    return Results(
        vehicles.tally_at_start,
        vehicles.tally_at_end,
        vehicles.tallies,
        [companion.plan_log for companion in vehicles.companions],
        vehicles.network.counters,
        sum(companion.bad_frames for companion in vehicles.companions),
        cpu,
    )


def obey(vehicles: Vehicles, now: int, instructions: Instructions) -> None:
    """Apply ``instructions`` to ``vehicles`` at ``now`` (µs)."""
    if instructions.begin:
        vehicles.begin(now)
    if instructions.ended:
        vehicles.end()
    for change in instructions.changes:
        vehicles.change(change)


def schedule(scenario: Scenario, *nodes: Any) -> list[Scheduled]:
    """Return the schedule of the nodes that are no vehicles: target, moving obstacles and operator."""
    return [Scheduled(node, scenario.timing.companion_us, EPOCH) for node in nodes]


class Team:
    """The other ``count`` − 1 processes of a flight, for its leader; ``watched``: they send snapshots.

    Raises InputError if there are more processes than vehicles, if a link between processes is faster than
    their exchange, or if the swarm link has a range, which needs the true places of all vehicles.
    """

    def __init__(
        self, fleet: Fleet, count: int, stopwatch: Callable[[], int], directory: Path | None, *, watched: bool
    ) -> None:
        self._fleet, self._stopwatch, self._directory = fleet, stopwatch, directory
        self.count = count
        self.watched = watched
        self._children = Children()
        self._ends: list[Connection] = []
        self._check()

    def start(self) -> None:
        """Start the processes."""
        for index in range(1, self.count):
            own, other = Pipe()
            share = Share(index, self.count)
            self._children.start(
                f"part-{index}",
                _work,
                self._fleet,
                share,
                self._stopwatch,
                self._directory,
                self.watched,
                other,
                [*self._ends, own],
            )
            other.close()
            self._ends.append(own)

    def exchange(self, sent: list[Sent]) -> list[Sent]:
        """Hand the leader's datagrams to the other processes, and theirs to each other; return theirs."""
        theirs: list[list[Sent]] = self._receive()
        for index in range(len(self._ends)):
            others = [one for k, part in enumerate(theirs) if k != index for one in part]
            self._send(index, sent + others)
        return [one for part in theirs for one in part]

    def reports(self) -> list[Report]:
        """Return the reports of the other processes at a sample, in the order of their vehicles."""
        return self._receive()

    def instruct(self, instructions: Instructions) -> None:
        """Send ``instructions`` to the other processes."""
        for index in range(len(self._ends)):
            self._send(index, instructions)

    def results(self) -> list[Results]:
        """Return the results of the other processes, which then end."""
        return self._receive()

    def stop(self) -> None:
        """End the processes: without the leader they end at their next exchange."""
        for end in self._ends:
            end.close()
        self._children.join(_END_S)

    def _receive(self) -> list[Any]:
        """Return what each process has sent; raises OutriderError if one has failed."""
        found = []
        for index, end in enumerate(self._ends, 1):
            try:
                message = end.recv()
            except (EOFError, OSError):
                raise OutriderError(f"process {index} of {self.count} of the flight ended") from None
            if isinstance(message, _Failure):
                raise OutriderError(
                    f"process {index} of {self.count} of the flight failed:\n{message.traceback}"
                )
            found.append(message)
        return found

    def _send(self, index: int, message: object) -> None:
        try:
            self._ends[index].send(message)
        except OSError:
            raise OutriderError(f"process {index + 1} of {self.count} of the flight ended") from None

    def _check(self) -> None:
        scenario, count = self._fleet.scenario, self.count
        if count > scenario.size:
            raise InputError(
                Fault("--processes", f"is {count}; allowed: 1 to {scenario.size}, the number of vehicles")
            )
        if count > 1 and scenario.links.swarm.range is not None:
            raise InputError(
                Fault(
                    "--processes",
                    f"is {count}, but links.swarm.range needs the places of all vehicles; allowed: 1",
                )
            )
        timing, delay = (
            scenario.timing,
            least_delay(self._fleet.channels(), scenario.timing.base_tick_us, _places(self._fleet, count)),
        )
        interval = -(-SAMPLE // timing.autopilot_us) * timing.autopilot_us
        if delay is not None and delay < interval:
            raise InputError(
                Fault(
                    "--processes",
                    f"is {count}, but a link between vehicles has a delay of {1e-3 * delay:g} ms; allowed: "
                    f"{1e-3 * interval:g} ms or more on the swarm, target and ground links, or one process",
                )
            )


class _Failure(NamedTuple):
    traceback: str


def _places(fleet: Fleet, count: int) -> dict[str, int]:
    """Return the process of each node."""
    scenario = fleet.scenario
    places = dict.fromkeys((names.TARGET, names.OPERATOR, *map(names.moving, scenario.moving_systems)), 0)
    for index in range(count):
        for k in Share(index, count).vehicles(scenario.size):
            for name in (names.autopilot, names.companion, names.backup_node):
                places[name(fleet.systems[k])] = index
    return places


def _work(
    fleet: Fleet,
    share: Share,
    stopwatch: Callable[[], int],
    directory: Path | None,
    watched: bool,
    end: Connection,
    others: Iterable[Connection],
) -> None:
    """Fly the vehicles of ``share`` as the leader at the other ``end`` instructs; main of the process."""
    # An interruption from the keyboard reaches the leader, which then closes its end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for other in others:
        other.close()
    started = time.process_time()

    def exchange(sent: list[Sent]) -> list[Sent]:
        end.send(sent)
        received: list[Sent] = end.recv()
        return received

    try:
        vehicles = Vehicles(fleet, share, stopwatch, directory, exchange)

        def watch(now: int) -> bool:
            part = vehicles.see(now)
            if part is None:
                return False
            # Both messages at once: the leader needs the report, and does not wait twice for this process.
            end.send(Report(part, vehicles.snapshots(now) if watched else []))
            vehicles.synchronise()
            instructions: Instructions = end.recv()
            obey(vehicles, now, instructions)
            return instructions.over

        scenario = fleet.scenario
        absent = (names.TARGET, *map(names.moving, scenario.moving_systems), names.OPERATOR)
        vehicles.run(schedule(scenario, *map(Elsewhere, absent)), watch)
        end.send(results_of(vehicles, time.process_time() - started))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        # The leader has ended, for a reason of its own.
        pass
    except Exception:
        end.send(_Failure(traceback.format_exc()))
