"""A vehicle outside its tube states this, and it and the others keep more distance where they can."""

from __future__ import annotations

import numpy as np
import pytest

from companion.avoidance.certified.committed import controls
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.certified.peer import Peer
from companion.avoidance.certified.qp import Objective
from companion.avoidance.field.planner import standing
from companion.config import CompanionConfig
from companion.values.horizon import Array, Motion
from companion.world import View, World
from mavlink_bridge.messages import Message, Source, Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE, Statement, unpack
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import FLEET
from tests.companion.avoidance.certified.test_commitment import HERE, LENGTH, STEPS, Subgoal, commitment
from tests.companion.avoidance.certified.test_commitment import standing as beside

CONFIG = CompanionConfig(task="goto", avoidance="certified", turning_sense="right")
TUBE, EPOCH_US = CONFIG.certified.tube, CONFIG.certified.epoch_us
NOTHING = View(None, None, None, None)
EAST = np.array([1.0, 0.0, 0.0])


def pulled(apart: float, outside: float, *, shares: bool, epochs: int = 20) -> float:
    """How near (m) plans come to one that stands ``apart`` m east, from which 2 m are to be kept, when their
    goal is where that one stands; one of the two is ``outside`` its tube."""
    kept, goal = commitment(), HERE + apart * EAST
    others = beside(kept.own(), apart * EAST, shares=shares)
    objective = Objective(np.broadcast_to(goal, (STEPS, 3)), np.zeros((STEPS, 3)), np.zeros((STEPS, 3)))
    least = np.inf
    for epoch in range(epochs):
        kept.turn(EPOCH + epoch * LENGTH)
        own = others if shares else beside(kept.own(), apart * EAST, shares=False)
        assert kept.replan(objective, Subgoal(goal, 0.0), own, outside)
        assert kept.following is not None
        least = min(least, apart - float(controls(kept.following)[..., 0].max()))
    return least


@pytest.mark.parametrize("outside", [0.0, 0.3, 1.0])
def test_new_plans_keep_so_much_more_on_their_own_side(outside: float) -> None:
    """Of plans that are agreed on 6 m apart, each side has half of the room beyond 2 m."""
    assert pulled(6.0, outside, shares=True) == pytest.approx(4.0 + outside, abs=0.02)
    assert pulled(6.0, outside, shares=False) >= 2.0 + outside - 0.02


@pytest.mark.parametrize("apart", [1.5, 2.0, 2.2])
@pytest.mark.parametrize("shares", [False, True])
def test_who_is_nearer_already_makes_plans_and_comes_no_nearer(apart: float, shares: bool) -> None:
    assert pulled(apart, 1.0, shares=shares, epochs=5) >= apart - 1e-3


class Pair:
    """Two flights whose messages arrive at once; where they are measured is told by the test."""

    def __init__(self) -> None:
        self.places = {1: HERE - 4.0 * EAST, 2: HERE + 4.0 * EAST}
        self.flights = {system: CertifiedFlight(CONFIG, Source(system, 195), FLEET) for system in (1, 2)}
        self.worlds = {system: World(CONFIG, system, 0, FLEET) for system in (1, 2)}
        for system, flight in self.flights.items():
            flight.stand(EPOCH, self.places[system])
        self.stated: dict[int, float] = {}

    def run(self, begins: int, ends: int, off: Array) -> None:
        """The first flies ``off`` (3,), m, beside its plan; the second on its plan."""
        for now in range(EPOCH + begins, EPOCH + ends, 20_000):
            for system, flight in self.flights.items():
                horizon = flight.horizon()
                assert horizon is not None
                motion = Motion(horizon.at(now).position + off * (system == 1), np.zeros(3), np.zeros(3))
                flight.watch(now, motion)
                if flight.due(now):
                    flight.plan(now, standing(self.places[system]), self.worlds[system], NOTHING)
                self._carry(system, now, flight.messages(now))

    def _carry(self, sender: int, now: int, messages: list[Message]) -> None:
        for message in messages:
            if isinstance(message, Tunnel):
                self.flights[3 - sender].receive(now, message)
                if message.payload_type == PAYLOAD_TYPE:
                    self.stated[sender] = unpack(message.payload).outside


def test_who_leaves_its_tube_states_by_how_much_until_it_is_back() -> None:
    pair = Pair()
    inside, outside = 0.9 * TUBE * EAST, (TUBE + 0.32) * EAST
    pair.run(0, 1_000_000, inside)
    assert pair.stated == {1: 0.0, 2: 0.0}
    pair.run(1_000_000, 2_000_000, outside)
    assert pair.stated == {1: pytest.approx(0.35), 2: 0.0}
    assert pair.flights[2].agreements.peers.outside == pytest.approx(0.35)
    assert pair.flights[1].tube.left == 1
    pair.run(2_000_000, 3_000_000, inside)
    assert pair.stated == {1: 0.0, 2: 0.0}
    assert pair.flights[2].agreements.peers.outside == 0.0


def test_a_statement_that_comes_again_counts_again() -> None:
    """Out of the tube, back, and out by as much: within one epoch the third statement equals the first."""
    peer = Peer(1, 2)
    for outside in (0.3, 0.0, 0.3):
        peer.receive(EPOCH, Statement(7, EPOCH, EPOCH, outside=outside), 0)
        assert peer.outside == outside
