"""The verdict on agreements, without a flight: each rule of planes and statements has runs that break it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.wire.agreements import Entry, Statement
from outrider.certify.evidence import Evidence, LoggedStatement
from outrider.certify.histories import Kind
from outrider.certify.verdict import judge
from tests.outrider.certify.agreed_evidence import (
    EPOCHS,
    A,
    B,
    aside,
    at,
    changed,
    found,
    nearer,
    swarm,
    with_entry,
)
from tests.outrider.certify.evidence import (
    BEGAN,
    DT,
    TERMS,
    Told,
    evidence,
    on,
    restated,
    standing,
    turned,
)


def test_those_that_agree_on_each_epoch_are_certified() -> None:
    verdict = judge(swarm())
    assert verdict.findings == ()
    document = verdict.document()
    assert document["agreements"] == EPOCHS
    # Each plan keeps the agreement before it and its own, the first only its own.
    assert document["planes_checked"] == 2 * (2 * EPOCHS - 1)
    assert all(step.kind is Kind.MADE for history in verdict.histories for step in history.steps[1:])


def test_of_three_each_two_agree() -> None:
    c = standing((0.0, 5.0, 5.0))
    verdict = judge(evidence({11: aside(A), 12: aside(B), 13: aside(c)}))
    assert verdict.findings == ()
    assert verdict.document()["agreements"] == 3 * EPOCHS


# A plan keeps the planes of the agreements in the lists


@pytest.mark.parametrize(("metres", "beyond"), [(0.89, False), (0.91, True)])
def test_a_plan_beyond_the_planes_is_found(metres: float, beyond: bool) -> None:
    """However far the other is: the planes leave each 0.9 m."""
    moved = nearer(A, metres)
    plans = [A, moved, on(moved), on(moved, 2)]
    verdict = judge(evidence({11: plans, 12: aside(B, 4)}))
    assert found(verdict) == ([("a plan beyond agreed planes", (11, 12))] if beyond else [])
    assert all(finding.time == at(1) and finding.figures.startswith("0.01") for finding in verdict.findings)
    least = verdict.pairs.nearest
    assert least is not None
    assert least.distance > 2.0


def pulses(metres: float, knots: int) -> list[int]:
    """Accelerations (mm/s²) that move a vehicle by ``metres`` in so many knots, and in as many to rest."""
    most = round(1e3 * metres / (1e-6 * DT * knots) ** 2)
    return [most] * knots + [-most] * knots


@pytest.mark.parametrize(("metres", "beyond"), [(1.34, False), (1.36, True)])
@pytest.mark.parametrize("behind", [False, True])
def test_planes_move_with_both_plans(metres: float, beyond: bool, behind: bool) -> None:
    """Both fly 1 m to the east: the one behind has 3/4 of the 1.8 m between them, and the other 1/4."""
    base = [*pulses(1.0, 5), 0, 0, 0, 0, 0]
    plans = {system: turned(at, [(a, 0, 0) for a in base]) for system, at in ((11, A), (12, B))}
    mover, by = (11, metres) if behind else (12, -metres / 3.0)
    changed = [(a + more, 0, 0) for a, more in zip(base[1:], pulses(by, 7), strict=True)]
    after = {system: on(plan) for system, plan in plans.items()}
    after[mover] = turned(after[mover], changed)
    sent = {system: [plan, after[system]] for system, plan in plans.items()}
    terms = TERMS._replace(a_max=(4000, 4000, 4000))
    crossing = [("a plan beyond agreed planes", (mover, 23 - mover))]
    assert found(judge(evidence(sent, terms._replace(shift=0.75)))) == (crossing if beyond else [])
    # With planes that do not move each has a half.
    assert found(judge(evidence(sent, terms))) == (crossing if behind else [])


@pytest.mark.parametrize("stale", [False, True])
def test_a_plan_that_keeps_only_older_planes_is_found(stale: bool) -> None:
    """12 comes 0.8 m nearer, and they agree on that; each may then come 0.5 m nearer, and not 0.8 m."""
    towards = nearer(B, -0.8)
    moved = nearer(A, 0.8 if stale else 0.48, epochs=2)
    verdict = judge(evidence({11: [A, on(A), moved], 12: [B, towards, on(towards)]}))
    assert found(verdict)[:1] == ([("a plan beyond agreed planes", (11, 12))] if stale else [])
    if stale:
        assert verdict.findings[0].time == at(2)


@given(st.integers(-1000, 1000), st.integers(-1000, 1000))
def test_who_keeps_the_planes_stays_apart(one: int, other: int) -> None:
    """For any two that turn from one agreement: too near is only who is beyond a plane."""
    plans = {11: [A, nearer(A, 1e-3 * one)], 12: [B, nearer(B, 1e-3 * other)]}
    whats = {what for what, _ in found(judge(evidence(plans)))}
    assert "plans nearer than certified" not in whats or "a plan beyond agreed planes" in whats
    assert bool(whats) == (one > 900 or other < -900)


def test_where_heights_do_not_count_planes_are_upright() -> None:
    """One above the other, 3 m to the east: it may not come nearer by as much as its height would allow."""
    high = standing((3.0, 0.0, 9.0))
    moved = nearer(high, -1.2)
    for upright in (False, True):
        verdict = judge(evidence({11: [A, on(A)], 12: [high, moved]}, TERMS._replace(upright=upright)))
        assert bool(verdict.findings) is upright


# An agreement enters a list


def test_what_was_dropped_is_not_taken_again() -> None:
    def again(statement: Statement) -> Statement:
        return with_entry(
            statement, lambda entry: entry._replace(agreements=((at(1), at(1)), *entry.agreements))
        )

    verdict = judge(changed(swarm(), 11, at(3), again))
    assert set(found(verdict)) >= {("an agreement taken again", (11, 12))}


def test_an_agreement_names_plans_that_both_were_told() -> None:
    def ahead(entry: Entry) -> Entry:
        return entry._replace(agreements=(*entry.agreements, (at(3), at(4))), considered=(at(3), at(4)))

    verdict = judge(changed(swarm(), 11, at(3), lambda statement: with_entry(statement, ahead)))
    assert set(found(verdict)) >= {
        ("an agreement on a plan newer than the own one", (11, 12)),
        ("an agreement on a plan that was not received", (11, 12)),
    }

    def nowhere(entry: Entry) -> Entry:
        return entry._replace(agreements=(*entry.agreements, (at(3) - 4, at(3))))

    verdict = judge(changed(swarm(), 11, at(3), lambda statement: with_entry(statement, nowhere)))
    assert ("an agreement on a plan that was not sent", (11, 12)) in found(verdict)


def test_a_plan_without_a_statement_is_found() -> None:
    def other(epoch: int) -> Evidence:
        return changed(swarm(), 11, epoch, lambda statement: statement._replace(entries=()))

    verdict = judge(other(at(3)))
    assert ("a plan without a statement", (11, 12)) in found(verdict)
    # The first plan needs no agreement.
    assert ("a plan without a statement", (11, 12)) not in found(judge(other(at(0))))


def test_what_was_heard_must_have_been_stated() -> None:
    whole = swarm()
    lost = tuple(
        log._replace(
            statements=tuple(s for s in log.statements if s.sender != 12 or s.statement.epoch != at(2))
        )
        if log.owner == 12
        else log
        for log in whole.logs
    )
    verdict = judge(whole._replace(logs=lost))
    assert ("a statement received that its sender did not send", (12, 11)) in found(verdict)


def test_a_statement_of_another_fleet_is_found_and_does_not_count() -> None:
    def elsewhere(statement: Statement) -> Statement:
        return statement._replace(fingerprint=TERMS.fleet_identity.fingerprint + 256)

    verdict = judge(changed(swarm(), 12, at(2), elsewhere))
    assert ("a statement of another fleet", (12,)) in found(verdict)
    assert ("an agreement dropped", (11, 12)) in found(verdict)


def test_all_statements_of_another_fleet_are_one_finding_of_their_sender() -> None:
    """As in a recording of a version with other rules: it has their number, and the time of the first one."""
    whole = swarm()
    foreign = TERMS.fleet_identity.fingerprint + 256
    for number in range(EPOCHS):
        whole = changed(whole, 12, at(number), lambda one: one._replace(fingerprint=foreign))
    own = [one for log in whole.logs if log.owner == 12 for one in log.statements if one.sender == 12]
    times = [one.time for one in own if one.statement.fingerprint == foreign]
    assert len(times) > 1
    [finding] = [one for one in judge(whole).findings if one.what == "a statement of another fleet"]
    assert (finding.who, finding.time) == ((12,), min(times))
    assert finding.figures.endswith(f", {len(times)} times")


def test_that_a_vehicle_is_away_changes_nothing() -> None:
    told = Told((11, 12), TERMS)
    plans = {11: aside(A), 12: aside(B)}
    for number in range(EPOCHS):
        told.of_epoch({system: [sent[number]] for system, sent in plans.items()})
        told.state(12, Statement(TERMS.fleet_identity.fingerprint, at(number), BEGAN, away=True))
    assert judge(told.evidence()).findings == judge(swarm()).findings == ()


@given(st.data())
def test_a_list_that_lacks_one_statement_is_certified_or_found(data: st.DataObject) -> None:
    """Whatever one vehicle has not heard: what it leaves out of account is told, and nothing but that."""
    whole = swarm()
    heard = [s for log in whole.logs if log.owner == 11 for s in log.statements if s.sender == 12]
    lost = data.draw(st.sets(st.sampled_from([s.number for s in heard]), max_size=4))

    def of(one: LoggedStatement) -> Statement | None:
        return None if one.owner == 11 and one.number in lost else one.statement

    verdict = judge(restated(whole, of))
    assert {who for _, who in found(verdict)} <= {(11, 12)}
    # The first statement of an epoch tells that 12 has the new agreement, before 11 drops the old one.
    firsts = {s.statement.epoch: s.number for s in reversed(heard)}
    late = [epoch for epoch, number in firsts.items() if number in lost and epoch != at(0)]
    dropped = [finding for finding in verdict.findings if finding.what == "an agreement dropped"]
    assert len(dropped) == len(late)


def test_how_often_vehicles_left_their_tubes_is_counted() -> None:
    """11 is outside in the epochs 1 and 2, and in 4."""
    whole = swarm()
    for number, outside in ((1, 0.1), (2, 0.35), (4, 0.05)):
        whole = changed(whole, 11, at(number), lambda s, outside=outside: s._replace(outside=outside))  # type: ignore[misc]
    document = judge(whole).document()
    assert (document["outside_tube"], document["most_outside_m"]) == (2, 0.35)
