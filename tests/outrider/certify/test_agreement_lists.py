"""The verdict on lists of agreements: when one is dropped, succeeded or withdrawn."""

from __future__ import annotations

import pytest

from mavlink_bridge.wire.agreements import Entry, Epochs, Statement
from outrider.certify.evidence import Evidence
from outrider.certify.verdict import judge
from tests.outrider.certify.agreed_evidence import (
    EPOCHS,
    A,
    B,
    at,
    changed,
    found,
    nearer,
    swarm,
    unheard,
    with_entry,
)
from tests.outrider.certify.evidence import (
    BEGAN,
    EPOCH,
    TERMS,
    Told,
    evidence,
    on,
)


def test_agreements_do_not_get_weaker() -> None:
    """12 goes away, and 11 follows it: the old plan of the one and the new one of the other are 2.2 m apart,
    which is less than the required 2.5 m, although no plans of one epoch are."""
    away = nearer(B, 1.5)
    whole = evidence(
        {11: [A, on(A), nearer(A, 0.8, epochs=2)], 12: [B, away, on(away)]}, TERMS._replace(required=2.5)
    )
    assert judge(whole).findings == ()

    def weaker(entry: Entry) -> Entry:
        mixed = at(2), at(0)
        return entry._replace(agreements=(*entry.agreements, mixed), considered=(at(2), at(2)))

    verdict = judge(changed(whole, 11, at(2), lambda statement: with_entry(statement, weaker)))
    assert ("an agreement nearer than the one before", (11, 12)) in found(verdict)
    assert "plans nearer than certified" not in {what for what, _ in found(verdict)}


# An agreement leaves a list


def test_who_drops_an_agreement_that_its_peer_has_not_succeeded_is_found() -> None:
    """It does not wait for the peer's statement that it has the newer one."""

    def early(statement: Statement) -> Statement:
        return with_entry(statement, lambda entry: entry._replace(agreements=entry.agreements[-1:]))

    verdict = judge(changed(swarm(), 11, at(3), early))
    assert ("an agreement dropped", (11, 12)) in found(verdict)
    # And it has made the plan of that epoch with no agreement that the other has stated.
    assert ("a plan without an agreement", (11, 12)) in found(verdict)


def test_a_succession_needs_a_statement_that_was_heard() -> None:
    verdict = judge(unheard(swarm(), 11, 12, at(3)))
    whats = found(verdict)
    assert whats.count(("an agreement dropped", (11, 12))) == EPOCHS - 3
    # From the next epoch on its plans stand on nothing that the other has stated.
    without = [finding.time for finding in verdict.findings if finding.what == "a plan without an agreement"]
    assert without == [at(4), at(5)]
    assert {who for _, who in whats} == {(11, 12)}


def proposed(*, lacks: bool, considers: bool, epoch: int) -> Evidence:
    """11 proposes an agreement on the plans of epoch 1, and drops it; 12 has stated that it lacks it, or that
    it has considered it, with its plan of ``epoch``. Both keep that of epoch 0."""
    first, second = (at(0), at(0)), (at(1), at(1))
    told = Told((11, 12), TERMS)
    told.of_epoch({11: [A], 12: [B]})
    told.plan(11, on(A))
    told.plan(12, on(B))

    def state(system: int, epoch: int, kept: tuple[Epochs, ...], considered: Epochs) -> None:
        entry = Entry(23 - system, kept, considered)
        told.state(
            system, Statement(TERMS.fleet_identity.fingerprint, epoch, BEGAN, (entry,)), at(1) - EPOCH // 4
        )

    state(11, at(1), (first, second), second)
    state(12, epoch, (first,) if lacks else (first, second), second if considers else first)
    state(11, at(1), (first,), second)
    return told.evidence()


@pytest.mark.parametrize(
    ("lacks", "considers", "epoch", "clean"),
    [
        (True, True, at(1), True),
        (True, False, at(1), False),
        (False, True, at(1), False),
        # It cannot have considered an agreement on a plan that it had not made.
        (True, True, at(0), False),
    ],
)
def test_a_withdrawal_needs_a_refusal_that_was_heard(
    lacks: bool, considers: bool, epoch: int, clean: bool
) -> None:
    verdict = judge(proposed(lacks=lacks, considers=considers, epoch=epoch))
    assert ((("an agreement dropped", (11, 12))) not in found(verdict)) is clean
    if clean:
        assert found(verdict) == []
