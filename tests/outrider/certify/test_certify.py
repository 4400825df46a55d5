"""The verdict on plans, without a flight: what is certified, and what is found.

What is found about agreements has a file of its own."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.wire.plan import Integers, WirePlan, pack, unpack
from outrider.certify.evidence import Evidence, FarewellChange, Log, UnreadablePayloads
from outrider.certify.histories import Kind
from outrider.certify.verdict import Verdict
from outrider.certify.verdict import judge as judge_all
from tests.outrider.certify.evidence import (
    ABOUT_AGREEMENTS,
    BEGAN,
    EPOCH,
    REQUIRED,
    STEPS,
    TERMS,
    accelerations,
    evidence,
    hull_excess,
    least_of_samples,
    on,
    places,
    standing,
    turned,
)

NEARER = "plans nearer than certified"
FAR = (0.0, 5.0, 0.0)
EAST: list[Integers] = [(1000, 0, 0)] * 5 + [(-1000, 0, 0)] * 5
"""A metre."""
A, B = standing((0.0, 0.0, 5.0)), standing((3.0, 0.0, 5.0))


def judge(whole: Evidence) -> Verdict:
    """The verdict, but for what is found about agreements."""
    verdict = judge_all(whole)
    left = tuple(finding for finding in verdict.findings if finding.what not in ABOUT_AGREEMENTS)
    return verdict._replace(findings=left)


def whats(verdict: Verdict) -> list[str]:
    return [finding.what for finding in verdict.findings]


def kinds(verdict: Verdict, system: int) -> list[Kind]:
    (history,) = (one for one in verdict.histories if one.system == system)
    return [step.kind for step in history.steps]


# Plans of one vehicle


def test_those_that_stand_apart_are_certified() -> None:
    verdict = judge(evidence({11: [A, on(A), on(A, 2)], 12: [B, on(B), on(B, 2)]}))
    assert verdict.certified
    document = verdict.document()
    assert document["pairs"] == document["epochs"] == 3
    assert document["least_m"] == pytest.approx(3.0, abs=1e-4)
    assert (document["plans"], document["carried_on"]) == (2, 4)
    assert document["unchecked"] == {"farewell": 0, "resting": 0}


@given(st.lists(st.one_of(st.none(), accelerations, st.just("elsewhere")), max_size=8))
def test_each_plan_is_told_from_the_one_before(moves: list[list[Integers] | str | None]) -> None:
    plans, expected = [A], [Kind.FIRST]
    for move in moves:
        goes_on = on(plans[-1])
        if move is None:
            plan, kind = goes_on, Kind.CARRIED_ON
        elif isinstance(move, str):
            x, y, z = goes_on.position
            plan, kind = goes_on._replace(position=(x + 1, y, z)), Kind.ANCHOR
        else:
            plan, kind = turned(goes_on, move), Kind.MADE
        expected.append(Kind.CARRIED_ON if plan == goes_on else kind)
        plans.append(plan)
    verdict = judge(evidence({11: plans, 12: []}))
    assert kinds(verdict, 11) == expected
    assert verdict.document()["anchors"] == expected.count(Kind.ANCHOR)


@given(accelerations, st.integers(0, 3), st.integers(0, 8 * 128 - 1), st.sampled_from([11, 12]))
def test_one_bit_of_one_log_is_found(move: list[Integers], number: int, bit: int, owner: int) -> None:
    moved = turned(on(A), move)
    sent = {
        11: [A, moved, on(moved), on(moved, 2)],
        12: [standing(FAR, A.epoch + k * EPOCH) for k in range(4)],
    }
    assume(judge(evidence(sent)).certified)
    original = sent[11][number]
    data = bytearray(pack(original))
    data[bit // 8] ^= 1 << bit % 8
    try:
        altered = unpack(bytes(data))
    except PlanWireError:
        return
    verdict = judge(_replaced(evidence(sent), owner, original, altered))
    assert not verdict.certified
    if altered.epoch == original.epoch:
        assert "1 bit differs" in " ".join(finding.figures for finding in verdict.findings)


def _replaced(whole: Evidence, owner: int, original: WirePlan, altered: WirePlan) -> Evidence:
    """One copy of 11's ``original`` in a log is ``altered``."""
    logs = []
    for log in whole.logs:
        sightings = []
        for one in log.sightings:
            if (log.owner, one.sender, one.plan) == (owner, 11, original):
                sightings.append(one._replace(plan=altered, copies=1))
                one = one._replace(copies=one.copies - 1)
            sightings.append(one)
        logs.append(log._replace(sightings=tuple(sightings)))
    return whole._replace(logs=tuple(logs))


def _without(whole: Evidence, owner: int, keep: Callable[[WirePlan], bool]) -> Evidence:
    """A log has lost some plans of its owner."""
    logs = [
        log._replace(sightings=tuple(s for s in log.sightings if s.sender != owner or keep(s.plan)))
        if log.owner == owner
        else log
        for log in whole.logs
    ]
    return whole._replace(logs=tuple(logs))


def test_what_was_heard_must_have_been_told() -> None:
    whole = evidence({11: [A, on(A)], 12: [B, on(B)]})
    verdict = judge(_without(whole, 11, lambda plan: plan.epoch == BEGAN))
    assert whats(verdict) == ["a plan received that its sender did not send"]
    assert verdict.findings[0].who == (11, 12)


def test_who_leaves_no_log_is_named_once() -> None:
    whole = evidence({11: [A, on(A)], 12: [B, on(B)]})
    verdict = judge(whole._replace(logs=whole.logs[:1]))
    assert whats(verdict) == ["no log of its own that can be read"]
    assert verdict.document()["pairs"] == 2


def test_who_tells_nothing_is_not_certified() -> None:
    verdict = judge(evidence({11: [A], 12: []}))
    assert whats(verdict) == ["no plan of its own"]
    assert verdict.findings[0].who == (12,)


def _faster(plan: WirePlan) -> WirePlan:
    x, y, z = plan.accelerations[0]
    return plan._replace(accelerations=((x, y + 1, z), *plan.accelerations[1:]))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (_faster, "rest"),
        (lambda plan: plan._replace(origin=8), "frame"),
        (lambda plan: plan._replace(dt=EPOCH // 2), "knots"),
        (lambda plan: plan._replace(epoch=plan.epoch + 4), "knots"),
        (lambda plan: plan._replace(accelerations=plan.accelerations[1:]), "knots"),
    ],
)
def test_what_nobody_takes_is_found_and_does_not_count(
    spoil: Callable[[WirePlan], WirePlan], said: str
) -> None:
    verdict = judge(evidence({11: [A, spoil(on(A)), on(A, 2)], 12: [B, on(B), on(B, 2)]}))
    (finding,) = verdict.findings
    assert said in finding.what
    assert finding.who == (11,)
    assert verdict.document()["pairs"] == 3


@pytest.mark.parametrize(("epochs", "usable"), [(-5, False), (-3, True), (10, True), (14, False)])
def test_a_plan_of_another_time_is_found(epochs: int, usable: bool) -> None:
    """Of one that no companion accepts: more than 4 epochs early, or more than 12 late."""
    whole = evidence({11: [A, on(A)], 12: [B, on(B)]})
    moved = tuple(
        log._replace(sightings=tuple(s._replace(time=s.time + epochs * EPOCH) for s in log.sightings))
        for log in whole.logs
    )
    found = {"a plan of another time", "no plan of its own"}
    assert found.isdisjoint(whats(judge(whole._replace(logs=moved)))) is usable


@pytest.mark.parametrize("most", [1999, 2000])
def test_an_acceleration_beyond_the_limits_is_found_once(most: int) -> None:
    moved = turned(on(A), [(0, -2000, 0), (0, 2000, 0)])
    terms = TERMS._replace(a_max=(2000, most, 2000))
    verdict = judge(evidence({11: [A, moved, on(moved)], 12: [B, on(B), on(B, 2)]}, terms))
    assert whats(verdict) == ([] if most == 2000 else ["an acceleration beyond the limits"])
    assert all("2.000 m/s² north, at most 1.999" in finding.figures for finding in verdict.findings)


@pytest.mark.parametrize("least", [-1999, -2000])
def test_so_is_one_below_a_least_value_of_its_own(least: int) -> None:
    moved = turned(on(A), [(0, -2000, 0), (0, 2000, 0)])
    terms = TERMS._replace(a_max=(2000, 5000, 2000), a_min=(-2000, least, -2000))
    verdict = judge(evidence({11: [A, moved, on(moved)], 12: [B, on(B), on(B, 2)]}, terms))
    assert whats(verdict) == ([] if least == -2000 else ["an acceleration beyond the limits"])
    assert all("-2.000 m/s² north, at least -1.999" in one.figures for one in verdict.findings)


def test_strangers_and_nonsense_are_found_but_not_moving_obstacles() -> None:
    whole = evidence({11: [A], 12: [B], 190: [standing(FAR)], 77: [standing(FAR)]})
    logs = [log for log in whole.logs if log.owner < 77]
    logs[1] = logs[1]._replace(garbled=(UnreadablePayloads(12, 11, BEGAN, 3),))
    terms = TERMS._replace(apart=frozenset({190}))
    verdict = judge(Evidence(terms, tuple(logs)))
    assert sorted(finding.who for finding in verdict.findings) == [(11, 12), (77,)]


# Pairs


def _head_on(epochs: int) -> list[WirePlan]:
    """11 comes a metre nearer to 12, and stays there."""
    moved = turned(on(A), EAST)
    return [A, *(on(moved, k) for k in range(epochs))]


@given(places, places, accelerations, accelerations, st.booleans())
def test_who_comes_too_near_is_found_exactly(
    here: tuple[float, float, float],
    there: tuple[float, float, float],
    one: list[Integers],
    other: list[Integers],
    again: bool,
) -> None:
    """Against fine samples of both motions: what they see is found, and what is found is nearer than a curve
    may be to its hull."""
    a, b = standing(here), standing(there)
    keeps = min(REQUIRED, least_of_samples(a, b))
    moved = turned(on(a), one), turned(on(b), other)
    sent = {11: [a, moved[0]], 12: [b, moved[1]]}
    if again:
        sent = {system: [*plans, on(plans[-1])] for system, plans in sent.items()}
    verdict = judge(evidence(sent, TERMS._replace(a_max=(1 << 15,) * 3)))
    found = NEARER in whats(verdict)
    sampled = least_of_samples(*moved)
    if sampled < keeps - 2e-6:
        assert found
    if found:
        assert sampled < keeps + hull_excess(*moved)
        # However long it lasts, it is one.
        assert whats(verdict) == [NEARER]
    nearest = verdict.pairs.nearest
    assert nearest is not None
    assert sampled - hull_excess(*moved) - 1e-9 <= nearest.distance <= sampled + 1e-9


def test_a_pair_that_began_nearer_may_stay_but_not_come_nearer() -> None:
    near, nearer = standing((1.0, 0.0, 5.0)), standing((0.9, 0.0, 5.0), BEGAN + EPOCH)
    began = judge(evidence({11: [A, on(A)], 12: [near, on(near)]}))
    assert began.certified
    assert began.document()["began_nearer"] == 1
    assert judge(evidence({11: [A, on(A)], 12: [B, on(B)]})).document()["began_nearer"] == 0
    # From an anchor on nothing is promised before they are far enough apart; it is told how often.
    verdict = judge(evidence({11: [A, on(A), on(A, 2)], 12: [near, nearer, on(nearer)]}))
    assert verdict.certified
    assert verdict.document()["anchors"] == 1
    assert verdict.document()["unchecked"] == {"farewell": 0, "resting": 2}
    moved = turned(on(near), [(-100, 0, 0)])
    verdict = judge(evidence({11: [A, on(A)], 12: [near, moved]}))
    assert whats(verdict) == [NEARER]
    assert verdict.findings[0].who == (11, 12)


def test_a_pair_that_got_apart_has_to_stay_apart() -> None:
    """0.9 m, then 1.1 m, then 1.0 m: more than at first, and less than it was."""
    near = standing((0.9, 0.0, 5.0))
    away = turned(on(near), [(1000, 0, 0), (0, 0, 0), (0, 0, 0), (-1000, 0, 0)])
    rests = on(away, STEPS)
    back = turned(on(rests), [(-1000, 0, 0), (0, 0, 0), (1000, 0, 0)])
    sent = [near, *(on(away, k) for k in range(STEPS + 1)), back]
    verdict = judge(evidence({11: [on(A, k) for k in range(len(sent))], 12: sent}))
    assert whats(verdict) == [NEARER]
    assert verdict.findings[0].time == back.epoch


def test_after_an_anchor_the_promise_begins_with_the_next_plans_that_are_apart() -> None:
    jumped = standing((2.0, 0.0, 5.0), BEGAN + EPOCH)
    gone = turned(on(jumped, 2), [(-1000, 0, 0)] * 5 + [(1000, 0, 0)] * 5)
    sent = {11: [on(A, k) for k in range(5)], 12: [B, jumped, on(jumped), gone, on(gone)]}
    verdict = judge(evidence(sent))
    assert kinds(verdict, 12) == [Kind.FIRST, Kind.ANCHOR, Kind.CARRIED_ON, Kind.MADE, Kind.CARRIED_ON]
    assert whats(verdict) == [NEARER]
    assert verdict.findings[0].time == BEGAN + 3 * EPOCH
    assert verdict.pairs.resting == 1


def test_who_is_silent_goes_on_as_told() -> None:
    """12 says nothing more after it has begun to move, and 11 comes to where it will be."""
    moved = turned(on(B), [(-x, y, z) for x, y, z in EAST])
    verdict = judge(evidence({11: _head_on(4), 12: [B, moved]}))
    assert whats(verdict) == [NEARER]
    assert verdict.document()["pairs"] == 5
    # Then it speaks again, and has done nothing else.
    silent = judge(evidence({11: [on(A, k) for k in range(5)], 12: [B, moved, on(moved, 3)]}))
    assert kinds(silent, 12) == [Kind.FIRST, Kind.MADE, Kind.CARRIED_ON]
    assert silent.certified
    # Or it makes a plan at once: nobody can have made one without its last.
    plan = turned(on(moved, 3), [(1000, 0, 0)] * 3)
    silent = judge(evidence({11: [on(A, k) for k in range(5)], 12: [B, moved, plan]}))
    assert kinds(silent, 12) == [Kind.FIRST, Kind.MADE, Kind.MADE]
    assert silent.certified


def test_whoever_said_farewell_is_no_longer_checked_until_it_is_back() -> None:
    over = standing((0.5, 0.0, 5.0))
    sent = {11: [on(A, k) for k in range(8)], 12: [B, on(B), on(B, 2)]}
    said = FarewellChange(BEGAN + EPOCH // 2, True)
    document = judge(evidence(sent, words={12: [said]})).document()
    assert document["certified"]
    assert (document["pairs"], document["unchecked"]["farewell"], document["farewells"]) == (1, 7, 1)
    # It comes back nearer than that, which is where it begins anew.
    back = over._replace(epoch=BEGAN + 5 * EPOCH)
    again = FarewellChange(back.epoch - EPOCH, False)
    sent[12] = [B, on(B), back, on(back), on(back, 2)]
    verdict = judge(evidence(sent, words={12: [said, again]}))
    assert verdict.certified
    assert kinds(verdict, 12) == [Kind.FIRST, Kind.CARRIED_ON, Kind.FIRST, Kind.CARRIED_ON, Kind.CARRIED_ON]
    assert (verdict.pairs.checked, verdict.pairs.farewell) == (4, 4)


def test_where_all_fly_at_one_height_only_the_rest_counts() -> None:
    above = standing((0.5, 0.0, 9.0))
    moved = turned(on(above), [(-100, 0, 0)])
    for upright in (False, True):
        terms = TERMS._replace(upright=upright)
        verdict = judge(evidence({11: [A, on(A)], 12: [above, moved]}, terms))
        assert verdict.certified is not upright


@given(accelerations, accelerations)
def test_neither_the_order_of_the_logs_nor_that_of_the_vehicles_matters(
    one: list[Integers], other: list[Integers]
) -> None:
    c = standing(FAR)
    sent = {11: [A, turned(on(A), one)], 12: [B, turned(on(B), other)], 13: [c, turned(on(c), other)]}
    whole = evidence(sent)
    documents = []
    for logs in permutations(whole.logs):
        fleet = tuple(log.owner for log in logs)
        document = judge(Evidence(whole.terms._replace(fleet=tuple(sorted(fleet))), logs)).document()
        documents.append(document)
    assert all(document == documents[0] for document in documents)


def test_no_evidence_is_no_certificate() -> None:
    verdict = judge(Evidence(TERMS, (Log(11, (), (), (), (), 0),)))
    assert not verdict.certified
    assert verdict.document()["least_m"] is None
    assert np.isfinite([verdict.seconds(finding.time) for finding in verdict.findings]).all()
