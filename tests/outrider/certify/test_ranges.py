"""Limited range, judged from logs: who may plan without an agreement, drop one, and how long plans may be."""

from __future__ import annotations

import pytest

from mavlink_bridge.wire.agreements import Entry, Epochs, Statement
from mavlink_bridge.wire.plan import WirePlan
from outrider.certify.evidence import Evidence, Reach
from outrider.certify.verdict import judge
from tests.outrider.certify.evidence import BEGAN, EPOCH, IDENTITY, TERMS, Told, on, standing, turned

REACH = Reach(range=8.0, contact=300_000, margins=0.2, sides=(1.5, 1.5, 1.5), speed=0.5)
LIMITED = TERMS._replace(reach=REACH)
_PUSHES = ((500, 0, 0), (0, 0, 0))
"""mm/s²: to 0.1 m/s, for a moment."""


def flown(
    apart: float,
    *,
    lists: dict[int, tuple[Epochs, ...]] | None = None,
    pushes: tuple[tuple[int, int, int], ...] = _PUSHES,
) -> Evidence:
    """11 stands, and makes a plan for the sixth epoch; 12 stands ``apart`` m from it.

    ``lists``: the agreements that 11 states about 12, by number of the epoch; without it, it names nobody. 12
    has stated each of them.
    """
    told = Told((11, 12), LIMITED)
    plans: dict[int, WirePlan] = {11: standing((0.0, 0.0, 5.0)), 12: standing((apart, 0.0, 5.0))}
    for number in range(8):
        if number:
            plans = {system: on(plan) for system, plan in plans.items()}
        if number == 5:
            plans[11] = turned(plans[11], pushes)
        for system, plan in plans.items():
            told.plan(system, plan)
        known = (lists or {}).get(number)
        theirs = () if known is None else (Entry(11, tuple((b, a) for a, b in known), (BEGAN, BEGAN)),)
        own = () if known is None else (Entry(12, known, (BEGAN, BEGAN)),)
        for system, entries in ((12, theirs), (11, own)):
            epoch = plans[system].epoch
            told.state(system, Statement(IDENTITY.fingerprint, epoch, BEGAN, entries))
    return told.evidence()


def findings(evidence: Evidence) -> list[str]:
    return [one.what for one in judge(evidence).findings]


BOTH: tuple[Epochs, ...] = ((BEGAN, BEGAN),)


def test_who_was_beyond_needs_no_agreement() -> None:
    assert not findings(flown(8.5))


@pytest.mark.parametrize("apart", [7.0, 2.0])
def test_a_plan_beside_a_near_vehicle_without_an_agreement_is_found(apart: float) -> None:
    """Also if the vehicle was never named: nobody needs to be."""
    found = judge(flown(apart)).findings
    assert [(one.what, one.who, one.time) for one in found] == [
        ("a plan without an agreement", (11, 12), BEGAN + 5 * EPOCH)
    ]
    assert "m apart in the time before" in found[0].figures


def test_an_agreement_lets_a_near_vehicle_plan() -> None:
    assert not findings(flown(2.0, lists=dict.fromkeys(range(8), BOTH)))


def test_an_agreement_may_be_dropped_beyond_the_range_alone() -> None:
    dropped: dict[int, tuple[Epochs, ...]] = {0: BOTH, 1: BOTH, 6: (), 7: ()}
    assert not findings(flown(8.5, lists=dropped))
    assert findings(flown(7.0, lists=dropped)) == ["a plan without an agreement", "an agreement dropped"]


def test_a_plan_that_is_longer_than_the_range_allows_is_found() -> None:
    fast = ((1000, 0, 0),) * 4 + ((0, 0, 0),) * 7 + ((-1000, 0, 0),) * 4
    assert findings(flown(9.5, pushes=fast)) == ["a plan longer than the range allows"]
