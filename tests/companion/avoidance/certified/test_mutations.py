"""The laws of the swarm notice each rule of the agreements that is missing: within 20 flights at random.

That a late farewell is refused takes more: it must arrive between two plans of a vehicle that is back.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from companion.avoidance.certified.constraint_sources import ConstraintSources
from companion.avoidance.certified.negotiation import AgreedPlans, Negotiation
from companion.avoidance.certified.pair import Agreement, Pair
from companion.avoidance.certified.peer import Peer
from companion.avoidance.certified.separating_planes import Others
from companion.values.horizon import Array
from tests.companion.avoidance.certified.draws import goals, starts
from tests.companion.avoidance.certified.swarm import NEVER, Habits, Rough, Swarm

FLIGHTS, MORE_FLIGHTS = 20, 150
Patch = pytest.MonkeyPatch


def fly(seed: int, kind: str) -> Swarm:
    """Three in a room that is too small, on a link that loses and delays.

    Of ``kind`` "away" some leave and return. Of "restart" a companion stops for longer than a plan and
    restarts, and nothing of the others is heard for a second from 0.5 s before.
    """
    rng = np.random.default_rng(seed)
    longest = 1_000_000 if kind == "away" else 400_000
    rough = Rough(float(rng.choice([0.0, 0.3, 0.6])), int(rng.choice([30_000, 150_000, longest])), 0.2)
    restarts = int(rng.integers(4_600_000, 5_200_000)) if kind == "restart" else NEVER
    habits = [Habits(frozen=((restarts - 4_000_000, restarts),), restarts=restarts)]
    if kind == "restart":
        rough = rough._replace(mute=tuple((restarts - 500_000, restarts + 500_000, whom) for whom in (2, 3)))
    for _ in range(3 - len(habits)):
        leaves = int(rng.integers(600_000, 2_000_000)) if kind == "away" else NEVER
        habits.append(Habits(leaves=leaves, returns=leaves + int(rng.choice([40_000, 300_000]))))
    swarm = Swarm(starts(3, seed), rough, habits, seed)
    swarm.run(8_000_000 if kind == "restart" else 4_000_000, goals(seed))
    return swarm


def drop_a_plane(patch: Patch) -> None:
    """A plan is made without the planes of the first agreement."""
    around = ConstraintSources.around

    def without(self: ConstraintSources, *given: Any) -> tuple[Others, Array]:
        others, field = around(self, *given)
        return Others(others.own[1:], others.controls[1:], others.distance[1:], others.shares[1:]), field

    patch.setattr(ConstraintSources, "around", without)


def plan_against_a_stale_plan(patch: Patch) -> None:
    """Planes are computed from the plan of the peer before the agreed one."""
    plans_of = Negotiation.plans_of

    def stale(self: Negotiation, peer: Peer, one: Agreement) -> AgreedPlans | None:
        found, older = plans_of(self, peer, one), peer.plans.before(one.other - 1)
        return found if found is None or older is None else found._replace(other=older)

    patch.setattr(Negotiation, "plans_of", stale)


def drop_an_agreement_without_confirmation(patch: Patch) -> None:
    """The older agreements are dropped as soon as a newer one is taken, and the newest counts."""
    take = Pair.take

    def only(self: Pair, one: Agreement) -> None:
        take(self, one)
        self.kept = (one,)

    patch.setattr(Pair, "take", only)
    patch.setattr(Pair, "confirmed", property(lambda self: self.kept[-1] if self.kept else None))


def skip_an_acknowledgement(patch: Patch) -> None:
    """An agreement that was taken counts as stated by the peer."""
    take = Pair.take

    def confirm(self: Pair, one: Agreement) -> None:
        self._stated.add(one)
        take(self, one)

    patch.setattr(Pair, "take", confirm)


def take_without_the_check(patch: Patch) -> None:
    """An agreement is taken though the newest plan crosses its planes."""
    patch.setattr(Negotiation, "_kept", lambda self, plan, plans, newest: True)


def ignore_since(patch: Patch) -> None:
    """That a peer has begun anew voids nothing."""
    receive = Pair.receive
    patch.setattr(
        Pair, "receive", lambda self, epoch, since, entry: receive(self, epoch, self._others_since, entry)
    )


def ignore_a_statement(patch: Patch) -> None:
    """What the peer has refused is kept, and what it lacks counts as stated."""
    receive = Pair.receive

    def deaf(self: Pair, epoch: int, since: int, entry: Any) -> bool:
        before = self.kept
        receive(self, epoch, since, entry._replace(agreements=tuple((two, one) for one, two in self.kept)))
        return self.kept != before

    patch.setattr(Pair, "receive", deaf)


def accept_a_late_farewell(patch: Patch) -> None:
    """A farewell is accepted though a later plan of its sender is known."""

    def accept(self: Peer, epoch: int) -> bool:
        plan = self.plans.get(epoch)
        if plan is not None:
            self.left = plan
            self.void(epoch + 1)
        return plan is not None

    patch.setattr(Peer, "_part", accept)


MUTATIONS = [
    pytest.param(drop_a_plane, "plain", id="drop a plane"),
    pytest.param(plan_against_a_stale_plan, "plain", id="plan against a stale plan"),
    pytest.param(drop_an_agreement_without_confirmation, "plain", id="drop without confirmation"),
    pytest.param(skip_an_acknowledgement, "plain", id="skip an acknowledgement"),
    pytest.param(take_without_the_check, "plain", id="take without the check"),
    pytest.param(ignore_since, "restart", id="ignore since"),
    pytest.param(ignore_a_statement, "plain", id="ignore a statement"),
    pytest.param(accept_a_late_farewell, "away", id="accept a late farewell"),
]


@pytest.mark.parametrize(("mutation", "kind"), MUTATIONS)
def test_a_missing_rule_is_noticed(mutation: Callable[[Patch], None], kind: str, monkeypatch: Patch) -> None:
    """By one of the laws that hold for the same flight with all rules."""
    mutation(monkeypatch)
    flights = MORE_FLIGHTS if mutation is accept_a_late_farewell else FLIGHTS
    broken = next((seed for seed in range(flights) if fly(seed, kind).faults()), None)
    assert broken is not None
    monkeypatch.undo()
    assert not fly(broken, kind).faults()


@pytest.mark.parametrize("kind", ["plain", "away", "restart"])
def test_these_flights_break_no_law_and_vehicles_replan_in_them(kind: str) -> None:
    for seed in range(3):
        swarm = fly(seed, kind)
        assert not swarm.faults()
        assert {made.system for made in swarm.made()} == {1, 2, 3}
    if kind == "restart":
        restarted = swarm.vehicles[0]
        assert any(made.since > restarted.habits.restarts for made in restarted.made)
