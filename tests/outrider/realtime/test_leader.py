"""The parts of a real-time run that need no process: who leads when somebody dies, and what strangers do."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.links.udp import MulticastLink
from mavlink_bridge.node import Datagram
from outrider.realtime import wiring as wirings
from outrider.realtime.flight import _Leader
from outrider.realtime.shared_page import SharedPage
from outrider.realtime.spawn import operators_turn, rough, turns
from outrider.runs import names
from outrider.runs.ground_truth import SAMPLE
from outrider.simulation import console
from outrider.simulation.conductor import PREPARE_CAP, Conductor, Stage
from outrider.simulation.fleet import Fleet
from tests.outrider.shipped import FIREFLY, LOGS, scenario

OF = scenario("antipodal-8", vehicles=2, airborne=True)
FLEET = Fleet(OF, FIREFLY, 1, LOGS)
START = 1_000_000


class Processes:
    """Stands for the crew: ``dead`` have ended."""

    def __init__(self) -> None:
        self.dead: dict[str, int] = {}
        self.told: list[tuple[str, str, int]] = []
        self.board: SharedPage

    def ended(self) -> dict[str, int]:
        return self.dead

    def freeze(self, name: str) -> None:
        self.told.append(("freeze", name, int(self.board.thaws.sum())))

    def thaw(self, name: str) -> None:
        self.told.append(("thaw", name, int(self.board.thaws.sum())))


class Led:
    def __init__(self) -> None:
        self.processes, self.board = Processes(), SharedPage(2)
        self.processes.board = self.board
        self.conductor = Conductor(OF, FLEET.starts, FLEET.operator(), START)
        processes: Any = self.processes
        self.leader = _Leader(FLEET, self.conductor, processes, self.board, lambda _stage, _seconds: None)
        self.now = START

    def look(self, seconds: float, *, interrupted: bool = False) -> bool:
        for _ in range(round(1e6 * seconds / SAMPLE)):
            self.now += SAMPLE
            if self.leader.look(self.now, interrupted):
                return True
        return False


@pytest.mark.parametrize("name", ["sitl-11", "companion-12", "target"])
def test_who_dies_before_anybody_was_seen_ends_the_run(name: str) -> None:
    led = Led()
    led.board.show_vehicle(0, np.zeros(3), np.zeros(3), False)
    assert not led.look(1.0)
    led.processes.dead = {name: -9}
    assert led.look(0.1)
    assert led.conductor.failure == f"the process of {name} ended with status -9"


def test_who_is_never_seen_ends_the_run_in_the_end() -> None:
    led = Led()
    led.board.show_vehicle(0, np.zeros(3), np.zeros(3), False)
    assert not led.look(1e-6 * PREPARE_CAP)
    assert led.look(0.1)
    assert led.conductor.failure == "vehicles never seen: 12"


def test_an_interrupt_before_anybody_was_seen_ends_the_run() -> None:
    led = Led()
    assert led.look(0.1, interrupted=True)
    assert led.conductor.stage is Stage.LAND


def test_a_thaw_is_on_the_board_before_the_process_goes_on() -> None:
    led = Led()
    led.leader.freeze(12)
    led.leader.thaw(12)
    assert led.processes.told == [("freeze", "companion-12", 0), ("thaw", "companion-12", 1)]
    assert led.board.thaws.tolist() == [0, 1]


def test_rows_of_the_board_do_not_touch() -> None:
    board = SharedPage(3)
    board.thaws[:] = 7
    board.gone[:] = 0
    board.show_vehicle(1, np.ones(3), np.zeros(3), False)
    board.show_companion(2, True, "nothing")
    assert board.thaws.tolist() == [7, 7, 7]
    assert board.gone.tolist() == [0, 0, 0]
    assert board.armed.tolist() == [True, False, True]
    assert board.ready.tolist() == [False, False, True]
    assert np.isnan(board.positions).any(axis=1).tolist() == [True, False, True]


# Strangers


class Listener:
    def __init__(self, name: str) -> None:
        self.name = name
        self.received: list[Datagram] = []

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        self.received += inbox
        return []


STRANGE = st.lists(
    st.builds(Datagram, st.sampled_from(["swarm", "target", "ground", "fog"]), st.binary(max_size=12)),
    max_size=8,
)


@given(STRANGE)
def test_what_no_node_of_the_run_sent_is_dropped_and_counts_nowhere(strange: list[Datagram]) -> None:
    for name, senders in ((names.TARGET, {}), (names.companion(11), {"swarm": None})):
        node = Listener(name)
        behind = rough(FLEET, node, senders)
        for tick in range(40):
            behind.step(tick * 2_500, strange)
        assert node.received == []
        assert (
            behind.network.counters.sent == behind.network.counters.unrouted == behind.network.under_way == 0
        )


def test_the_own_echo_is_a_stranger_and_a_companion_is_none() -> None:
    node = Listener(names.companion(11))
    behind = rough(FLEET, node, {"swarm": None})
    frames = [bytes([0xFD, 0, 0, 0, 0, system]) + bytes(6) for system in (11, 12)]
    behind.step(0, [Datagram("swarm", frame) for frame in frames])
    assert behind.network.counters.sent == 1
    behind.step(10**6, [])
    assert node.received == [Datagram("swarm", frames[1])]


def test_two_runs_have_groups_of_their_own_even_on_the_same_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    ports = wirings._free_ports(3)
    monkeypatch.setattr(wirings, "_free_ports", lambda _count: ports)
    clock = WallClock()
    runs = [wirings.wire(2, clock) for _ in range(2)]
    try:
        links = [run.companions[0]["swarm"][0] for run in runs]
        assert all(isinstance(link, MulticastLink) for link in links)
        groups = [link.address for link in links if isinstance(link, MulticastLink)]
        assert groups[0][1] == groups[1][1]
        assert groups[0][0] != groups[1][0]
    finally:
        for run in runs:
            run.close_others({})


def test_the_bar_has_no_thread_that_a_fork_could_tear(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    before = threading.active_count()
    with console.progress(10.0) as watch:
        watch(Stage.CLOCK, 1.0)
        assert threading.active_count() == before


@given(seed=st.integers(0, 1000), vehicles=st.integers(1, 8), start=st.integers(1, 10**15))
def test_no_two_are_due_at_one_instant_whatever_their_clocks_show(
    seed: int, vehicles: int, start: int
) -> None:
    of = scenario("antipodal-8", vehicles=vehicles, clocks={"offset_ms": 500.0})
    fleet, period, start = Fleet(of, FIREFLY, seed, LOGS), of.timing.companion_us, start // 4 * 4
    due = []
    for k in range(vehicles):
        autopilot, companion, clock = turns(fleet, k, start)
        assert start <= min(autopilot, companion)
        assert max(autopilot, companion) < start + 2 * period
        due += [autopilot % period, clock.instant(companion) % period]
    due.append(operators_turn(fleet, start) % period)
    due.sort()
    gaps = np.diff([*due, due[0] + period])
    assert (gaps >= period // (2 * vehicles + 2) - 20).all()
