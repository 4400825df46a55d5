"""The verdict on vehicles that begin anew, say farewell, or return."""

from __future__ import annotations

import pytest

from mavlink_bridge.wire.agreements import Entry, Statement
from outrider.certify.evidence import Evidence
from outrider.certify.verdict import judge
from tests.outrider.certify.agreed_evidence import (
    A,
    B,
    aside,
    at,
    found,
    swarm,
    unheard,
)
from tests.outrider.certify.evidence import (
    BEGAN,
    EPOCH,
    TERMS,
    Told,
    evidence,
    on,
    restated,
    standing,
)


def anew(*, stated: bool) -> Evidence:
    """12 begins anew elsewhere in epoch 2, and says so or not."""
    jumped = standing((4.0, 0.0, 5.0), at(2))
    whole = evidence({11: [on(A, k) for k in range(5)], 12: [B, on(B), *aside(jumped, 3)]})
    if stated:
        return whole
    return restated(
        whole,
        lambda one: one.statement._replace(since=BEGAN) if one.sender == 12 else one.statement,
    )


def test_who_begins_anew_says_so() -> None:
    assert judge(anew(stated=True)).findings == ()
    assert judge(anew(stated=True)).document()["anchors"] == 1
    assert found(judge(anew(stated=False))) == [("a new beginning that is not stated", (12,))]


def parting(*, farewell: bool = True, newest: bool = True, considered: int = BEGAN) -> Evidence:
    """12 says farewell with its plan of epoch 1, which is its newest or not; 11 makes plans without it.

    ``considered``: epoch of the plan of 11 that the farewell names.
    """
    told = Told((11, 12), TERMS)
    plans = aside(A, 4)
    told.of_epoch({11: plans[:1], 12: [B]})
    told.of_epoch({11: [plans[1]], 12: [on(B)]})
    if not newest:
        told.plan(12, on(B, 2))
    entry = Entry(11, considered=(at(1), considered))
    told.state(12, Statement(TERMS.fleet_identity.fingerprint, at(1), BEGAN, (entry,), farewell))
    for plan in plans[2:]:
        told.plan(11, plan)
        told.state(
            11, Statement(TERMS.fleet_identity.fingerprint, plan.epoch, BEGAN, (Entry(12, departed=True),))
        )
    return told.evidence()


def test_only_who_has_said_farewell_is_left_out() -> None:
    assert judge(parting()).findings == ()
    for run in (parting(farewell=False), parting(newest=False), parting(considered=BEGAN - EPOCH)):
        assert ("a departure without a farewell", (11, 12)) in found(judge(run))


@pytest.mark.parametrize("stated", [False, True])
def test_who_returns_says_so_and_counts_on_no_farewell_of_before(stated: bool) -> None:
    """11 has accepted the farewell of 12, says farewell, and makes plans beside the last plan of 12 anew."""
    told = Told((11, 12), TERMS)
    plans = aside(A, 5)
    told.of_epoch({11: plans[:1], 12: [B]})
    told.of_epoch({11: [plans[1]], 12: [on(B)]})
    told.state(
        12,
        Statement(
            TERMS.fleet_identity.fingerprint, at(1), BEGAN, (Entry(11, considered=(at(1), BEGAN)),), True
        ),
    )
    departed = (Entry(12, departed=True),)
    told.plan(11, plans[2])
    told.state(11, Statement(TERMS.fleet_identity.fingerprint, at(2), BEGAN, departed))
    told.state(11, Statement(TERMS.fleet_identity.fingerprint, at(2), BEGAN, departed, farewell=True))
    for plan in plans[3:]:
        told.plan(11, plan)
        told.state(
            11, Statement(TERMS.fleet_identity.fingerprint, plan.epoch, at(3) if stated else BEGAN, departed)
        )
    expected = ("a departure without a farewell", (11, 12)), ("a return that is not stated", (11,))
    assert expected[not stated] in found(judge(told.evidence()))
    assert expected[stated] not in found(judge(told.evidence()))


# A plan is made with an agreement with each


def test_who_is_carried_on_needs_no_agreement() -> None:
    whole = evidence({11: [on(A, k) for k in range(5)], 12: [on(B, k) for k in range(5)]})
    silent = judge(unheard(whole, 11, 12, at(0)))
    assert ("a plan without an agreement", (11, 12)) not in found(silent)


@pytest.mark.parametrize("own", [False, True])
def test_an_agreement_that_is_void_allows_no_plan(own: bool) -> None:
    """The one that both have stated is on a plan of before one of them began anew."""
    verdict = judge(
        restated(
            swarm(),
            lambda one: (
                one.statement._replace(since=at(3))
                if one.sender == (11 if own else 12) and one.statement.epoch >= at(2)
                else one.statement
            ),
        )
    )
    assert ("a plan without an agreement", (11, 12)) in found(verdict)


# Statements
