"""The verdict on agreements, without a flight: a clean run passes, and each rule has runs that break it."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.wire.agreements import Entry, Epochs, Statement
from mavlink_bridge.wire.plan import Integers, WirePlan
from outrider.certify.evidence import Evidence, LoggedStatement
from outrider.certify.histories import Kind
from outrider.certify.verdict import Verdict, judge
from tests.outrider.certify.evidence import (
    BEGAN,
    DT,
    EPOCH,
    TERMS,
    Told,
    evidence,
    on,
    restated,
    standing,
    turned,
)

A, B = standing((0.0, 0.0, 5.0)), standing((3.0, 0.0, 5.0))
"""3 m apart, of which 1.2 m are required: each may come 0.9 m nearer."""
EPOCHS = 6
Change = Callable[[Statement], Statement | None]


def at(number: int) -> int:
    """The epoch with this ``number`` (µs)."""
    return BEGAN + number * EPOCH


def aside(plan: WirePlan, count: int = EPOCHS) -> list[WirePlan]:
    """``plan``, and plans made after it that go north and back, in turn."""
    plans = [plan]
    for number in range(1, count):
        way = 300 if number % 2 else -300
        plans.append(turned(on(plans[-1]), [(0, way, 0), (0, -way, 0)]))
    return plans


def nearer(plan: WirePlan, metres: float, epochs: int = 1) -> WirePlan:
    """A plan made ``epochs`` after ``plan``, which rests: ``metres`` towards east."""
    most = round(1000 * metres)
    accelerations: list[Integers] = [(most, 0, 0)] * 5 + [(-most, 0, 0)] * 5
    return turned(on(plan, epochs), accelerations)


def swarm() -> Evidence:
    """Two that make a plan in each epoch."""
    return evidence({11: aside(A), 12: aside(B)})


def found(verdict: Verdict) -> list[tuple[str, tuple[int, ...]]]:
    return [(finding.what, finding.who) for finding in verdict.findings]


def changed(whole: Evidence, system: int, epoch: int, change: Change) -> Evidence:
    """What ``system`` states in ``epoch`` is as ``change`` has it, in all logs."""

    def of(one: LoggedStatement) -> Statement | None:
        if (one.sender, one.statement.epoch) != (system, epoch):
            return one.statement
        return change(one.statement)

    return restated(whole, of)


def with_entry(statement: Statement, change: Callable[[Entry], Entry]) -> Statement:
    return statement._replace(entries=tuple(change(entry) for entry in statement.entries))


def unheard(whole: Evidence, owner: int, sender: int, since: int) -> Evidence:
    """``owner`` has heard no statement of ``sender`` from the epoch ``since`` on."""

    def of(one: LoggedStatement) -> Statement | None:
        lost = (one.owner, one.sender) == (owner, sender) and one.statement.epoch >= since
        return None if lost else one.statement

    return restated(whole, of)


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


def test_a_plan_without_a_statement_is_found() -> None:
    def other(epoch: int) -> Evidence:
        return changed(swarm(), 11, epoch, lambda statement: statement._replace(entries=()))

    verdict = judge(other(at(3)))
    assert ("a plan without a statement", (11, 12)) in found(verdict)
    # The first plan needs no agreement.
    assert ("a plan without a statement", (11, 12)) not in found(judge(other(at(0))))


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
    assert judge(swarm()).document()["outside_tube"] == 0
