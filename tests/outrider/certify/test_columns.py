"""The verdict on take-offs and landings: in a column that all others keep, or it is a finding."""

from __future__ import annotations

import pytest

from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.plan import Integers, WirePlan
from outrider.certify.command import show
from outrider.certify.evidence import Evidence, LoggedStatement, Order
from outrider.certify.verdict import Verdict, judge
from tests.outrider.certify.evidence import BEGAN, EPOCH, TERMS, evidence, on, restated, standing, turned

WIDE = TERMS._replace(further=0.3)
GROUND = standing((0.0, 0.0, 0.0))._replace(column=True)
BESIDE = standing((3.0, 0.0, 5.0))
EPOCHS = 8
LEAVES = 6
"""Number of the epoch of the first plan in space."""


def at(number: int) -> int:
    """The epoch with this ``number`` (µs)."""
    return BEGAN + number * EPOCH


def climbing() -> list[WirePlan]:
    column = [on(GROUND, k) for k in range(LEAVES)]
    up = on(GROUND, LEAVES).at_height(5.0)
    return [*column, *(on(up, k) for k in range(EPOCHS - LEAVES))]


def ordered(whole: Evidence, epoch: int, *, climbs: bool = True) -> Evidence:
    """11 orders its autopilot to climb, or to land, half an epoch before ``epoch``."""
    first, *others = whole.logs
    number = max(one.number for one in first.statements if one.statement.epoch <= at(epoch))
    order = Order(at(epoch) - EPOCH // 2, climbs, number)
    return whole._replace(logs=(first._replace(orders=(*first.orders, order)), *others))


def flight(other: list[WirePlan] | None = None, order: int = 3, own: list[WirePlan] | None = None) -> Verdict:
    plans = [on(BESIDE, k) for k in range(EPOCHS)] if other is None else other
    return judge(ordered(evidence({11: own or climbing(), 12: plans}, WIDE), order))


def kinds(verdict: Verdict) -> set[str]:
    return {finding.what for finding in verdict.findings}


def passing(east: float, height: float = 5.0) -> list[WirePlan]:
    """Plans of 12 that come ``east`` m nearer to the column in the epoch 4."""
    still = [on(standing((3.0, 0.0, height)), k) for k in range(4)]
    most = round(1000 * east)
    back: list[Integers] = [(-most, 0, 0)] * 5 + [(most, 0, 0)] * 5
    moved = turned(on(still[0], 4), back)
    return [*still, *(on(moved, k) for k in range(EPOCHS - 4))]


def test_a_climb_in_a_reserved_column_is_certified() -> None:
    verdict = flight()
    assert verdict.findings == ()
    assert verdict.pairs.checked == EPOCHS


def test_a_column_may_be_left_at_any_height_but_nowhere_else() -> None:
    elsewhere = [*climbing()[:LEAVES], *(on(standing((0.1, 0.0, 5.0)), k) for k in range(LEAVES, EPOCHS))]
    assert len(flight(own=elsewhere).document()["findings"]) == 0
    assert flight(own=elsewhere).document()["anchors"] == 1
    assert flight().document()["anchors"] == 0


def test_a_climb_before_the_reservation_is_found() -> None:
    (finding,) = flight(order=0).findings
    assert finding.what == "a climb without a reservation"
    assert finding.who[0] == 11


def test_a_climb_without_a_whole_epoch_since_the_reservation_is_found() -> None:
    """Reserved half an epoch before the first one: until its end the others may fly a plan made before."""
    whole = ordered(evidence({11: climbing(), 12: [on(BESIDE, k) for k in range(EPOCHS)]}, WIDE), 0)
    first, second = whole.logs
    (order,) = first.orders
    found = {}
    for time in (at(0) + EPOCH // 2, at(1) - 1, at(1)):
        moved = order._replace(time=time, number=order.number + 1)
        logs = first._replace(orders=(moved,)), second
        found[time - at(0)] = [one.figures for one in judge(whole._replace(logs=logs)).findings]
    late = ["reserved for less than an epoch"]
    assert found == {EPOCH // 2: late, EPOCH - 1: late, EPOCH: []}


def test_a_landing_before_the_column_rests_is_found() -> None:
    """It brakes for seven epochs, reserved long before."""
    moving = turned(standing((-1.5, 0.0, 5.0)), [(600, 0, 0), (600, 0, 0), (-600, 0, 0)])
    own = [on(moving, k)._replace(column=True) for k in range(24)]
    whole = evidence({11: own, 12: [on(BESIDE, k) for k in range(24)]}, WIDE)
    (finding,) = judge(ordered(whole, 6, climbs=False)).findings
    assert (finding.what, finding.figures) == ("a descent without a reservation", "its column does not rest")
    assert judge(ordered(whole, 20, climbs=False)).findings == ()


@pytest.mark.parametrize(("east", "found"), [(1.7, True), (1.9, False)])
@pytest.mark.parametrize("height", [0.0, 40.0])
def test_a_climb_beside_one_that_is_parked_too_near_is_found(east: float, found: bool, height: float) -> None:
    """Its column adds 0.3 m, as the climbing one does."""
    parked = standing((east, 0.0, height))._replace(column=True)

    def farewell(one: LoggedStatement) -> Statement:
        said = one.statement
        if one.sender == 12:
            answers = Entry(11, considered=(said.epoch, said.epoch))
            return said._replace(entries=(answers,), farewell=True)
        return said._replace(entries=(Entry(12, departed=True),))

    whole = evidence({11: climbing(), 12: [on(parked, k) for k in range(EPOCHS)]}, WIDE)
    verdict = judge(ordered(restated(whole, farewell), 3))
    figures = [one.figures for one in verdict.findings if one.what == "a climb without a reservation"]
    assert figures == (["the last plan of 12 is too near"] if found else [])


@pytest.mark.parametrize(
    ("begins", "place", "figures"),
    [
        (0, (3.0, 0.0, 5.0), "its column was not reserved"),
        (4, (3.0, 0.0, 5.0), None),
        (4, (1.4, 0.0, 5.0), "its plan is too near the column"),
    ],
)
def test_a_column_may_be_left_beside_one_that_begins_anew_if_that_is_away(
    begins: int, place: tuple[float, ...], figures: str | None
) -> None:
    """From the epoch ``begins`` on 12 has begun anew at ``place``, and no agreement was made since."""
    anew = [on(BESIDE if k < begins else standing(place), k) for k in range(EPOCHS)]

    def unheard(one: LoggedStatement) -> Statement:
        said = one.statement
        if said.epoch < at(begins):
            return said
        if one.sender == 12:
            return said._replace(since=at(begins), entries=(Entry(11),))
        kept = said.entries[0].considered
        return said._replace(entries=(Entry(12, considered=kept if begins == 0 else (at(begins - 1),) * 2),))

    whole = evidence({11: climbing(), 12: anew}, WIDE)
    findings = judge(restated(whole, unheard)).findings
    found = [
        one.figures for one in findings if one.what == "a plan without an agreement" and one.who[0] == 11
    ]
    assert found == ([] if figures is None else [figures])


@pytest.mark.parametrize("late", [2, 4, 5])
def test_a_late_step_does_not_end_a_reservation(late: int) -> None:
    """11 announces no plan of the epoch ``late``; from the epoch 5 on 12 has begun anew."""
    own = [plan for plan in climbing() if plan.epoch != at(late)]
    anew = [on(BESIDE if k < 5 else standing((3.0, 0.0, 5.0)), k) for k in range(EPOCHS)]

    def unheard(one: LoggedStatement) -> Statement:
        said = one.statement
        if said.epoch < at(5):
            return said
        if one.sender == 12:
            return said._replace(since=at(5), entries=(Entry(11),))
        return said._replace(entries=(Entry(12, considered=(at(3),) * 2),))

    findings = judge(restated(evidence({11: own, 12: anew}, WIDE), unheard)).findings
    assert "a plan without an agreement" not in {one.what for one in findings if one.who[0] == 11}


def test_table_and_json_count_the_same_plans(capsys: pytest.CaptureFixture[str]) -> None:
    """The first plan, and the one in space that the column becomes."""
    verdict = judge(evidence({11: climbing()}, WIDE))
    show("run", verdict)
    (row,) = (line for line in capsys.readouterr().out.splitlines() if "plans made" in line)
    assert row.replace("│", "").split()[-1] == str(verdict.document()["plans"]) == "2"


def test_a_climb_without_a_column_is_found() -> None:
    space = [plan._replace(column=False) for plan in climbing()[:LEAVES]]
    (finding, *_) = flight(own=space).findings
    assert finding.what == "a climb without a reservation"
    assert finding.figures == "its plan is no column"


def test_a_climb_beside_one_that_states_nothing_is_found() -> None:
    def silent(one: LoggedStatement) -> Statement | None:
        return None if one.sender == 12 and one.owner == 11 else one.statement

    whole = evidence({11: climbing(), 12: [on(BESIDE, k) for k in range(EPOCHS)]}, WIDE)
    found = kinds(judge(ordered(restated(whole, silent), 3)))
    assert "a climb without a reservation" in found


@pytest.mark.parametrize(("east", "found"), [(0.70, False), (0.80, True), (2.9, True)])
def test_a_plan_that_does_not_keep_a_column_is_found(east: float, found: bool) -> None:
    """3 m apart, of which 1.2 m and 0.3 m are required: it may come 0.75 m nearer, at any height."""
    for height in (5.0, 40.0):
        assert ("a plan beyond agreed planes" in kinds(flight(passing(east, height)))) is found


def test_above_a_column_plans_are_too_near() -> None:
    assert "plans nearer than certified" in kinds(flight(passing(2.9, 40.0)))


def test_an_agreement_too_near_a_column_is_found() -> None:
    near = [on(standing((1.3, 0.0, 5.0)), k) for k in range(EPOCHS)]
    assert "an agreement too near a column" in kinds(flight(near))


def test_a_landing_needs_a_column_and_others_keep_it_for_ever() -> None:
    up = standing((0.0, 0.0, 5.0))
    own = [up, *(on(up, k)._replace(column=True) for k in range(1, EPOCHS))]
    whole = evidence({11: own, 12: [on(BESIDE, k) for k in range(EPOCHS)]}, WIDE)
    assert judge(ordered(whole, 4, climbs=False)).findings == ()
    (finding,) = judge(ordered(whole, 1, climbs=False)).findings
    assert finding.what == "a descent without a reservation"
    over = evidence({11: own, 12: passing(2.9, 40.0)}, WIDE)
    assert "plans nearer than certified" in kinds(judge(ordered(over, 3, climbs=False)))
