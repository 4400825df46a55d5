"""The laws of the swarm notice each rule of the agreements that is missing: within 20 flights at random."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from companion.avoidance.certified.commitment import Commitment
from companion.avoidance.certified.constraint_sources import ConstraintSources
from companion.avoidance.certified.negotiation import AgreedPlans, Negotiation
from companion.avoidance.certified.pair import Agreement, Pair
from companion.avoidance.certified.peer import Peer
from companion.avoidance.certified.separating_planes import Others
from companion.values.horizon import Array
from tests.companion.avoidance.certified.flights import Kind, fly

FLIGHTS = 20
Patch = pytest.MonkeyPatch


def drop_a_plane(patch: Patch) -> None:
    """A plan is made without the planes of the first agreement."""
    around = ConstraintSources.around

    def without(self: ConstraintSources, *given: Any) -> tuple[Others, Array]:
        others, field = around(self, *given)
        return others._replace(agreed=None if others.agreed is None else others.agreed[1:]), field

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


def accept_a_farewell_without_an_answer(patch: Patch) -> None:
    """A farewell is accepted though its sender may not know of the own return."""
    patch.setattr(Peer, "_answers", lambda self, farewell, since: True)


def accept_a_farewell_while_away(patch: Patch) -> None:
    """A vehicle that returns counts on the farewells that it received while it was away."""
    answers, leave = Peer._answers, Peer.leave

    def keep(self: Peer, epoch: int) -> None:
        left = self.left
        leave(self, epoch)
        self.left = left

    patch.setattr(Peer, "leave", keep)
    patch.setattr(Peer, "_answers", lambda self, farewell, since: answers(self, farewell, max(since, 1)))


def begin_with_the_next_epoch(patch: Patch) -> None:
    """A companion that restarts makes a plan of an epoch of which it may have announced one before."""
    begin = Commitment.begin

    def at_once(self: Commitment, now: int, position: Array) -> int:
        announced = self.announced_until
        self.announced_until = max(announced, self.epoch(now))
        free = begin(self, now, position)
        self.announced_until = announced
        return free

    patch.setattr(Commitment, "begin", at_once)


MUTATIONS = [
    pytest.param(drop_a_plane, "plain", id="drop a plane"),
    pytest.param(plan_against_a_stale_plan, "plain", id="plan against a stale plan"),
    pytest.param(drop_an_agreement_without_confirmation, "plain", id="drop without confirmation"),
    pytest.param(skip_an_acknowledgement, "plain", id="skip an acknowledgement"),
    pytest.param(take_without_the_check, "plain", id="take without the check"),
    pytest.param(ignore_since, "restart", id="ignore since"),
    pytest.param(ignore_a_statement, "plain", id="ignore a statement"),
    pytest.param(accept_a_late_farewell, "late", id="accept a late farewell"),
    pytest.param(accept_a_farewell_without_an_answer, "together", id="accept a farewell without an answer"),
    pytest.param(accept_a_farewell_while_away, "together", id="accept a farewell while away"),
    pytest.param(begin_with_the_next_epoch, "quick", id="begin with the next epoch"),
]


@pytest.mark.parametrize(("mutation", "kind"), MUTATIONS)
def test_a_missing_rule_is_noticed(mutation: Callable[[Patch], None], kind: Kind, monkeypatch: Patch) -> None:
    """By one of the laws that hold for the same flight with all rules."""
    mutation(monkeypatch)
    broken = next((seed for seed in range(FLIGHTS) if fly(seed, kind).faults()), None)
    assert broken is not None
    monkeypatch.undo()
    assert not fly(broken, kind).faults()


@pytest.mark.parametrize("kind", ["plain", "away", "late", "together", "restart", "quick"])
def test_these_flights_break_no_law_and_vehicles_replan_in_them(kind: Kind) -> None:
    for seed in range(3):
        swarm = fly(seed, kind)
        assert not swarm.faults()
        assert {made.system for made in swarm.made()} == {vehicle.system for vehicle in swarm.vehicles}
    if kind in ("restart", "quick"):
        restarted = swarm.vehicles[0]
        assert any(made.since > restarted.habits.restarts for made in restarted.made)
