"""Workers of a fleet: each node with its impaired links, its schedule, and its events."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path

from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.clocks.node_clock import QUANTUM, NodeClock
from mavlink_bridge.loops.lockstep import Scheduled
from mavlink_bridge.network.channel import Channel
from mavlink_bridge.node import Node
from outrider.realtime.impaired_link import ImpairedLink
from outrider.realtime.shared_page import SharedPage
from outrider.realtime.wiring import Wiring
from outrider.realtime.workers import AutopilotWorker, CompanionWorker, NodeEnvironment, PlayedWorker, Worker
from outrider.runs import names
from outrider.scenarios.faults import ClockStep, Restart
from outrider.scenarios.links import PartitionPart
from outrider.simulation.disturbances import events
from outrider.simulation.ending_companion import EndingCompanion
from outrider.simulation.fleet import Fleet
from outrider.simulation.moving import MovingObstacle
from outrider.simulation.targets import Target


def spawn(
    fleet: Fleet, wiring: Wiring, clock: Clock, board: SharedPage, start: int, logs: Path, scratch: Path
) -> list[Worker]:
    """Return one worker for each node but the operator, due from ``start`` (µs) on.

    The tlogs are written to ``logs``, the true traces to ``scratch``. Phases are spread, so that few workers
    are due at the same instant: on few cores the last of these would be late.
    """
    start -= start % QUANTUM
    timing, happening = fleet.scenario.timing, events(fleet.scenario)
    cuts = [event for event in happening if isinstance(event.what, PartitionPart)]
    workers: list[Worker] = []
    for k, system in enumerate(fleet.systems):
        autopilot = fleet.autopilot(k)
        companion = EndingCompanion(partial(fleet.companion, k, time.thread_time_ns, start))
        own = [event for event in happening if getattr(event.what, "vehicle", None) == system]
        computers = [event for event in own if isinstance(event.what, ClockStep | Restart)]
        behind = rough(fleet, autopilot, {"autopilot": companion.name, "sight": None})
        first, phase, its_clock = turns(fleet, k, start)
        every = Scheduled(behind, timing.autopilot_us, first)
        trace = scratch / f"trace-{system}"
        workers.append(
            AutopilotWorker(
                k, autopilot, trace, NodeEnvironment(behind, every, wiring.autopilots[k], clock, board), own
            )
        )
        senders = {
            "autopilot": autopilot.name,
            "swarm": None,
            "target": names.TARGET,
            "ground": names.OPERATOR,
        }
        behind = rough(fleet, companion, senders)
        every = Scheduled(behind, timing.companion_us, phase, its_clock)
        workers.append(
            CompanionWorker(
                k,
                companion,
                system,
                logs,
                NodeEnvironment(behind, every, wiring.companions[k], clock, board),
                sorted([*cuts, *computers], key=lambda event: event.after),
            )
        )
    for index, k in enumerate(fleet.with_backup):
        backup_node = fleet.backup_of(k)
        # The node's link ``autopilot`` receives data of the autopilot and of the companion. Both count as
        # sent by the companion, which is on the same computer.
        behind = rough(fleet, backup_node, {"autopilot": names.companion(fleet.systems[k]), "swarm": None})
        turn = start + staggered(2 * len(fleet.systems) + index, _slots(fleet), timing.companion_us)
        every = Scheduled(behind, timing.companion_us, turn, fleet.clock(k, start))
        workers.append(Worker(NodeEnvironment(behind, every, wiring.backup_nodes[index], clock, board)))
    phase = start + staggered(_slots(fleet) - 2, _slots(fleet), timing.companion_us)
    target, obstacles = fleet.target(), fleet.moving()
    played: list[Target | MovingObstacle] = [target, *obstacles]
    shown = fleet.shown(target, obstacles)
    for node, seen, links in zip(played, shown, [wiring.target, *wiring.moving], strict=True):
        behind = rough(fleet, seen, {})
        every = Scheduled(behind, timing.companion_us, phase)
        workers.append(PlayedWorker(node, NodeEnvironment(behind, every, links, clock, board)))
    return workers


def turns(fleet: Fleet, k: int, start: int) -> tuple[int, int, NodeClock]:
    """Return the first due times (µs) of autopilot ``k`` and its companion, and the companion's clock.

    The companion's time is on its own clock. At ``start`` all phases are evenly spread in true time, whatever
    the clocks' offsets; later they drift.
    """
    timing, slots, clock = fleet.scenario.timing, _slots(fleet), fleet.clock(k, start)
    turn = start + staggered(2 * k, slots, timing.companion_us)
    companion = turn + (clock.local(turn) - turn) % timing.companion_us
    autopilot = start + staggered(2 * k + 1, slots, timing.companion_us) % timing.autopilot_us
    return autopilot, companion, clock


def operators_turn(fleet: Fleet, start: int) -> int:
    """Return the time (µs) at which the operator is first due: in the last slot after ``start`` (µs)."""
    slots = _slots(fleet)
    return start - start % QUANTUM + staggered(slots - 1, slots, fleet.scenario.timing.companion_us)


def _slots(fleet: Fleet) -> int:
    """Return the number of slots.

    There is one for each autopilot, companion and backup node, one for target and moving obstacles together,
    and one for the operator.
    """
    return 2 * len(fleet.systems) + len(fleet.with_backup) + 2


def staggered(k: int, count: int, period: int) -> int:
    """Return the phase (µs) in ``period`` of node ``k`` of ``count``: evenly spread, multiple of QUANTUM."""
    return k * period // count // QUANTUM * QUANTUM


def rough(fleet: Fleet, node: Node, senders: dict[str, str | None]) -> ImpairedLink:
    """Return ``node`` behind the links that the scenario defines; ``senders`` as for ``ImpairedLink``."""
    return ImpairedLink(
        node,
        senders,
        _channels(fleet, node.name),
        fleet.seed,
        fleet.scenario.timing.base_tick_us,
        fleet.target_system,
    )


def _channels(fleet: Fleet, receiver: str) -> list[Channel]:
    """Return a channel to ``receiver``, with its faults, from every node that can send to it."""
    found = []
    for channel in fleet.channels():
        link = channel.members.get(receiver)
        if link is None:
            continue
        for sender, name in channel.members.items():
            if sender != receiver:
                faults = channel.overrides.get((sender, receiver), channel.faults)
                ends = {sender: name, receiver: link}
                found.append(Channel(f"{channel.name}-{sender}", ends, faults, counted=channel.counted))
    return found
