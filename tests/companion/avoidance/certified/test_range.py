"""Limited range, a law for each step of its proof: who is not counted is not met, and who was met agrees."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.committed import carried_on, controls, horizon_of
from companion.avoidance.certified.fingerprint import FleetIdentity
from companion.avoidance.certified.margins import between, fastest, further, sideways
from companion.avoidance.certified.negotiation import Geometry
from companion.avoidance.certified.pair import Agreement, Pair
from companion.avoidance.certified.peer_plans import StoredPlan, stored
from companion.avoidance.certified.plan_sides import plan_sides
from companion.avoidance.certified.vicinity import Vicinity, region, within_region
from companion.config import CompanionConfig
from companion.config.certified import CertifiedConfig
from companion.errors import CompanionError
from companion.values.horizon import Array
from mavlink_bridge.wire.agreements import Entry
from mavlink_bridge.wire.plan import pack
from tests.companion.avoidance.certified.flown import EXACT
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS, curves, random_plan
from tests.companion.avoidance.certified.rough import NEVER, Habits, Rough
from tests.companion.avoidance.certified.swarm import TICK, Swarm
from tests.companion.avoidance.certified.two import (
    DISTANCES,
    FRAME,
    LENGTH,
    NOW,
    OTHER,
    OWN,
    THIRD,
    plan,
    statement,
)

RANGE, CONTACT, V_MAX = 8.0, 300_000, (1.5, 1.5, 0.3)
FLOWN = {"range": RANGE, "contact_us": CONTACT, "tube": 0.05, "drift": 0.05, "clock_us": 0, "sigmas": 0.0}
seeds = st.integers(0, 2**32 - 1)


def config(**certified: Any) -> CompanionConfig:
    return CompanionConfig.model_validate(
        {
            "avoidance": "certified",
            "certified": {**FLOWN, **certified},
            "limits": {"v_max": V_MAX},
            "field": {"position_sigma": 0.1},
        }
    )


@given(
    seeds,
    st.floats(7.0, 60.0),
    st.floats(0.0, 2.0),
    st.integers(20_000, 400_000),
    st.booleans(),
    st.sampled_from([0.05, 0.3]),
)
@settings(max_examples=60, deadline=None)
def test_who_was_beyond_in_the_last_two_contacts_is_not_met(
    seed: int, reach: float, sigmas: float, contact: int, planar: bool, drift: float
) -> None:
    """Whatever both do meanwhile at the speeds of plans, and along plans that are short enough.

    Seen from above: so it does not matter whether one of the two, or both, land or take off.
    """
    of = config(range=reach, contact_us=contact, sigmas=sigmas, drift=drift)
    of = of.model_copy(update={"planar": planar})
    try:
        sides = plan_sides(of)
    except CompanionError:
        return
    assert sides is not None
    rng = np.random.default_rng(seed)
    way = rng.normal(size=(500, 2))
    way /= np.linalg.norm(way, axis=1)[:, None]
    # True places were beyond the range; plans differ from them.
    apart = (reach - 2.0 * sideways(of.certified, of.field, of.limits)) * way
    meanwhile = 1e-6 * (2 * contact + 2 * of.certified.epoch_us) * fastest(of.limits)
    sharpness = rng.uniform(0.0, 0.3, (500, 1))
    for _ in range(2):
        towards = -way + sharpness * rng.normal(size=(500, 2))
        apart = apart + meanwhile * towards / np.linalg.norm(towards, axis=1)[:, None]
        apart = apart - np.sign(way) * sides[:2] * rng.uniform(0.9, 1.0, (500, 2))
    least = between(of.certified, of.field, of.limits) + 2.0 * further(of.certified)
    assert (np.linalg.norm(apart, axis=1) >= least).all()


def test_a_range_without_room_for_plans_is_refused() -> None:
    with pytest.raises(CompanionError, match=r"certified\.range = 2 m leaves no room for plans; more than"):
        plan_sides(config(range=2.0))
    assert plan_sides(config(range=None)) is None


@given(seeds, st.floats(0.1, 4.0))
@settings(max_examples=60, deadline=None)
def test_the_region_holds_the_committed_plan_and_is_as_large_as_it_may_be(seed: int, side: float) -> None:
    rng = np.random.default_rng(seed)
    own = controls(random_plan(rng, rng.uniform(-5, 5, 3)))
    sides = np.array([side, side, 0.5 * side])
    low, high = region(own, rng.uniform(-9, 9, 3), sides)
    lengths = np.ptp(own.reshape(-1, 3), axis=0)
    assert (own >= low - 1e-12).all()
    assert (own <= high + 1e-12).all()
    np.testing.assert_allclose(high - low, np.maximum(lengths, sides), atol=1e-9)


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_a_short_plan_stays_short_when_it_is_carried_on(seed: int) -> None:
    rng = np.random.default_rng(seed)
    made = random_plan(rng, rng.uniform(-5, 5, 3))
    sides = np.ptp(controls(made).reshape(-1, 3), axis=0)
    for knots in range(STEPS + 2):
        rest = controls(carried_on(made, knots))
        assert within_region(rest, rest, sides)
        assert (np.ptp(curves(rest).reshape(-1, 3), axis=0) <= sides + EXACT).all()
    assert not within_region(0.5 * controls(made), controls(made), 0.9 * sides)


@given(seeds, st.integers(-3 * LENGTH, 8 * LENGTH))
@settings(max_examples=40, deadline=None)
def test_who_seems_beyond_is_beyond_however_old_the_plan_is(seed: int, later: int) -> None:
    """The other flies its plan in the plan's epoch, and otherwise anything at the speeds of plans."""
    rng = np.random.default_rng(seed)
    of = config()
    vicinity, speed = Vicinity(of), fastest(of.limits)
    theirs = stored(random_plan(rng, rng.uniform(-12, 12, 3), speed=0.8))
    now, place = EPOCH + later, rng.uniform(-12, 12, 3)
    if not vicinity.beyond(now, place, theirs):
        return
    margins = 2.0 * sideways(of.certified, of.field, of.limits)
    if 0 <= later < LENGTH:
        flown = horizon_of(theirs.plan).at(now).position
        assert np.linalg.norm((flown - place)[:2]) > RANGE + margins
        return
    ends = theirs.controls[0, 0], theirs.controls[0, 2]
    since = [1e-6 * abs(later - at) * speed for at in (0, LENGTH)]
    steps = rng.normal(size=(1000, 3))
    steps *= (rng.uniform(0.8, 1.0, 1000) / np.linalg.norm(steps, axis=1))[:, None]
    nearest = int(np.argmin(since))
    there = ends[nearest] + since[nearest] * steps
    possible = there[np.linalg.norm(there - ends[1 - nearest], axis=1) <= since[1 - nearest]]
    assert (np.linalg.norm((possible - place)[:, :2], axis=1) > RANGE + margins).all()


@given(seeds, st.floats(0.0, 0.999), st.sampled_from([1, 2]))
@settings(max_examples=40, deadline=None)
def test_in_the_epoch_of_a_plan_it_is_known_who_is_beyond(seed: int, share: float, knots: int) -> None:
    """However near the limit, and however many knots an epoch has: it never depends on the time."""
    rng = np.random.default_rng(seed)
    of = config(epoch_us=knots * DT, dt_us=DT)
    later = int(share * of.certified.epoch_us)
    theirs = stored(random_plan(rng, rng.uniform(-12, 12, 3), speed=0.8))
    now = EPOCH + later
    flown = horizon_of(theirs.plan).at(now).position
    limit = RANGE + 2.0 * sideways(of.certified, of.field, of.limits)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    way = np.array([np.cos(angle), np.sin(angle), 0.0])
    vicinity = Vicinity(of)
    assert vicinity.beyond(now, flown + (limit + EXACT) * way, theirs)
    assert not vicinity.beyond(now, flown + (limit - EXACT) * way, theirs)


def limited(far: float = 10.0) -> Agreements:
    """Of a vehicle that is at the origin and counts nobody whose plan begins ``far`` m from it or further."""

    def beyond(_now: int, one: StoredPlan) -> bool:
        return float(np.linalg.norm(one.controls[0, 0] - (0.0, 0.0, 5.0))) >= far

    of = CertifiedConfig(epoch_us=LENGTH, dt_us=DT, fleet=(OWN, OTHER, THIRD), range=50.0)
    geometry = Geometry(DISTANCES.apart, DISTANCES.agreed)
    one = Agreements(OWN, of, STEPS, FleetIdentity(FRAME, FRAME & 0xFF), geometry, beyond)
    one.begin(EPOCH)
    one.made(plan())
    return one


def met(one: Agreements, x: float = 4.0) -> None:
    """The other is heard ``x`` m away, and has taken the agreement that the vehicle proposes."""
    one.receive_plan(NOW, OTHER, pack(plan(x=x)))
    one.receive_statement(NOW, OTHER, statement(0))
    one.update(NOW)
    both = Entry(OWN, ((EPOCH, EPOCH),), (EPOCH, EPOCH))
    one.receive_statement(NOW, OTHER, statement(0, both))


def test_nobody_is_waited_for_before_he_is_heard() -> None:
    one = limited()
    assert not one.peers.members
    one.receive_plan(NOW, OTHER, pack(plan(x=4.0)))
    assert one.missing() == {OTHER}
    one.receive_statement(NOW, OTHER, statement(0, Entry(THIRD)))
    assert one.peers.members == {OTHER}


def test_who_is_heard_beyond_the_range_costs_nothing_and_is_met_anew() -> None:
    one = limited()
    met(one)
    assert one.kept() == {OTHER: (Agreement(EPOCH, EPOCH),)}
    assert not one.missing()
    one.receive_plan(NOW + LENGTH, OTHER, pack(plan(1, x=11.0)))
    assert not one.peers.members | one.kept().keys() | {entry.peer for entry in one.entries(every=True)}
    one.receive_plan(NOW + 2 * LENGTH, OTHER, pack(plan(2, x=9.0)))
    assert one.missing() == {OTHER}
    (entry,) = one.entries(every=True)
    # The other learns that the agreement is gone for good.
    assert (entry.agreements, entry.considered) == ((), (EPOCH, EPOCH))


def test_who_has_begun_anew_within_the_range_is_counted_whatever_its_old_plans_say() -> None:
    """Another controller has flown it here; its first plan begins with the next epoch."""
    one = limited()
    one.receive_plan(NOW, OTHER, pack(plan(x=11.0)))
    assert not one.peers.members
    one.receive_plan(NOW + 5 * LENGTH, OTHER, pack(plan(6, x=4.0)))
    assert one.peers.members == {OTHER}


def test_the_plan_of_the_present_epoch_counts_until_the_next_one_begins() -> None:
    one = limited()
    one.receive_plan(NOW, OTHER, pack(plan(x=11.0)))
    one.receive_plan(NOW, OTHER, pack(plan(1, x=9.0)))
    assert not one.peers.members
    one.receive_plan(NOW + LENGTH, OTHER, pack(plan(1, x=9.0)))
    assert one.peers.members == {OTHER}


@pytest.mark.parametrize("first", [LENGTH, 2 * LENGTH])
def test_no_plan_of_before_it_began_anew_shows_that_a_vehicle_is_beyond(first: int) -> None:
    """Its first plan here is lost, and the statement that came with it is not."""
    one = limited()
    one.receive_plan(NOW, OTHER, pack(plan(x=11.0)))
    one.receive_plan(NOW, OTHER, pack(plan(1, x=11.0)))
    one.receive_statement(NOW, OTHER, statement(1))
    assert not one.peers.members
    one.receive_statement(NOW + LENGTH, OTHER, statement(2, since=2))
    assert one.peers.members == {OTHER}
    # Nor do a repeated plan, a late plan and a late statement.
    one.receive_plan(NOW + LENGTH, OTHER, pack(plan(1, x=11.0)))
    one.receive_plan(NOW + LENGTH, OTHER, pack(plan(-1, x=11.0)))
    one.receive_statement(NOW + LENGTH, OTHER, statement(1))
    assert one.peers.members == {OTHER}
    one.receive_plan(NOW + first, OTHER, pack(plan(2, x=11.0)))
    assert not one.peers.members


def test_one_under_another_controller_is_not_counted_for_its_beginnings() -> None:
    """It begins anew wherever it has left its plan, and sends no plan of that."""
    one = limited()
    one.receive_plan(NOW, OTHER, pack(plan(x=11.0)))
    one.receive_statement(NOW, OTHER, statement(0))
    flown = statement(0, since=1)._replace(away=True)
    one.receive_statement(NOW + LENGTH, OTHER, flown)
    assert not one.peers.members
    one.receive_statement(NOW + LENGTH, OTHER, statement(1, since=1))
    assert one.peers.members == {OTHER}


def test_who_is_silent_stays_counted() -> None:
    one = limited()
    met(one)
    one.update(NOW + 100 * LENGTH)
    assert one.kept() == {OTHER: (Agreement(EPOCH, EPOCH),)}


def test_the_first_agreement_after_a_meeting_needs_plans_that_are_apart() -> None:
    near, away = limited(), limited()
    met(near, x=0.5)
    met(away, x=1.5)
    assert near.missing() == {OTHER}
    assert not away.missing()


def test_a_late_statement_does_not_offer_again_what_was_dropped() -> None:
    """The peer has dropped the agreement on its second plan because of the range; both messages are late."""
    dropped, offered = (
        Entry(OWN, (), (3 * LENGTH, LENGTH)),
        Entry(OWN, ((3 * LENGTH, LENGTH),), (3 * LENGTH, LENGTH)),
    )
    for parts in (False, True):
        pair = Pair(OTHER, OWN, parts=parts)
        pair.receive(4 * LENGTH, LENGTH, dropped)
        pair.receive(3 * LENGTH, LENGTH, offered)
        assert bool(pair.offers) != parts


def flown(seed: int, rough: Rough, *, vehicles: int = 4, until: int = 9_000_000) -> tuple[Swarm, Array]:
    """Vehicles from a ring of 7 m to about the opposite place; most hear each other only on the way."""
    rng = np.random.default_rng(seed)
    angles = 2.0 * np.pi * (np.arange(vehicles) + rng.uniform(-0.2, 0.2, vehicles)) / vehicles
    ring = np.stack([7.0 * np.cos(angles), 7.0 * np.sin(angles), np.full(vehicles, 5.0)], axis=1)
    goals = ring * (-1.0, -1.0, 1.0) + rng.uniform(-1.0, 1.0, (vehicles, 3)) * (1.0, 1.0, 0.0)
    swarm = Swarm(
        ring, rough, [Habits()] * vehicles, seed, strangers=True, planar=True, settings=FLOWN, v_max=V_MAX
    )
    swarm.run(until, lambda _since, system: goals[system - 1])
    return swarm, goals


@pytest.mark.parametrize("loss", [pytest.param(0.0, marks=pytest.mark.slow), 0.3])
def test_a_fleet_with_a_range_stays_apart_and_arrives(loss: float) -> None:
    rough = Rough(loss, 60_000, 0.2, reach=RANGE + 2.0)
    swarm, goals = flown(7, rough, vehicles=3, until=13_000_000)
    assert swarm.least() >= swarm.d - EXACT
    ends = [vehicle.flight.commitment.own()[-1, 2] for vehicle in swarm.vehicles]
    np.testing.assert_allclose(ends, goals, atol=0.05)
    parted = [vehicle.flight.agreements for vehicle in swarm.vehicles]
    assert any(len(one.peers.members) < 2 for one in parted)


def test_four_that_meet_in_two_lines_turn_back_and_arrive() -> None:
    """Two that stand head on have their goals turned back, where boxes towards the goals have no room."""
    starts = np.array([(x, y, 5.0) for x in (-5.0, 5.0) for y in (-0.6, 0.6)])
    goals = starts * (-1.0, -1.0, 1.0)
    rough, habits = Rough(0.0, 20_000), [Habits()] * 4
    swarm = Swarm(starts, rough, habits, 1, strangers=True, planar=True, settings=FLOWN, v_max=V_MAX)
    swarm.run(17_000_000, lambda _since, system: goals[system - 1])
    assert swarm.least() >= swarm.d - EXACT
    ends = [vehicle.flight.commitment.own()[-1, 2] for vehicle in swarm.vehicles]
    np.testing.assert_allclose(ends, goals, atol=0.1)


@pytest.mark.parametrize("loss", [0.0, 0.3])
def test_who_rests_about_as_far_as_the_range_is_not_waited_for(loss: float) -> None:
    """Of each pair that stands a little beyond the limit, both fly to their goals, which are 1 m aside."""
    limit = RANGE + 2.0 * sideways(config().certified, config().field, config().limits)
    # Plans are made in the middle of an epoch, as far from its ends as possible.
    early = {**FLOWN, "lead_us": DT // 2, "last_call_us": DT // 2}
    for more in np.linspace(-0.02, 0.4, 8):
        starts = np.array([[0.0, 0.0, 5.0], [limit + more, 0.0, 5.0]])
        goals = starts + np.array([0.0, 1.0, 0.0])
        rough = Rough(loss, 60_000, reach=RANGE + 2.0)
        swarm = Swarm(
            starts, rough, [Habits()] * 2, 1, strangers=True, planar=True, settings=early, v_max=V_MAX
        )
        swarm.run(5_000_000, lambda _since, system, goals=goals: goals[system - 1])
        ends = [vehicle.flight.commitment.own()[-1, 2] for vehicle in swarm.vehicles]
        np.testing.assert_allclose(ends, goals, atol=0.05)


LOW = {**FLOWN, "range": 4.0}
"""For vehicles that fly so slowly that they may stop in short plans, one high above another."""
SLOW = (0.4, 0.4, 0.4)


def above(lands: int, aside: float) -> Swarm:
    """Vehicle 1 hovers 6 m above the other, beyond the range, and is to land; the other flies ``aside``."""
    starts = np.array([[0.0, 0.0, 9.5], [0.0, 0.0, 3.5]])
    habits = [Habits(lands=lands), Habits()]
    swarm = Swarm(starts, Rough(0.2, 60_000), habits, 5, strangers=True, settings=LOW, v_max=SLOW)
    goals = starts + np.array([[0.0, 0.0, 0.0], [aside, 0.0, 0.0]])
    swarm.run(11_000_000, lambda _since, system: goals[system - 1])
    return swarm


def test_nobody_lands_on_a_vehicle_far_below() -> None:
    """It is counted at whatever height, so that no agreement on a column above it is made."""
    swarm = above(1_500_000, aside=0.0)
    assert not swarm.vehicles[0].columns
    assert not swarm.unflagged()
    moved = above(1_500_000, aside=1.5)
    assert moved.vehicles[0].columns
    assert moved.least() >= moved.d - moved.exact


@pytest.mark.parametrize("loss", [0.0, pytest.param(0.3, marks=pytest.mark.slow)])
def test_vehicles_with_a_range_take_off_meet_and_land(loss: float) -> None:
    """One goes from the ground to a place beside the others, which it does not hear at first; all land."""
    starts = np.array([[0.0, 0.0, 5.0], [6.5, 0.0, 5.0], [8.0, 1.5, 5.0]])
    goals = np.array([[4.0, 0.5, 5.0], [6.0, 0.0, 5.0], [8.0, 1.0, 5.0]])
    habits = [Habits(takes_off=0, lands=14_000_000), Habits(lands=15_000_000), Habits(lands=14_500_000)]
    rough = Rough(loss, 60_000, reach=6.0)
    swarm = Swarm(starts, rough, habits, 3, strangers=True, planar=True, settings=LOW, v_max=(0.8, 0.8, 0.2))
    swarm.run(19_000_000, lambda _since, system: goals[system - 1])
    assert swarm.least() >= swarm.d - swarm.exact
    assert not set(swarm.faults()) - {"no agreement in common"}
    assert all(vehicle.columns and vehicle.columns[-1][1] == NEVER for vehicle in swarm.vehicles)
    climbs, _ = swarm.vehicles[0].columns
    assert climbs[0] >= 2 * CONTACT - TICK


def test_nobody_moves_before_he_has_listened() -> None:
    swarm, _ = flown(1, Rough(reach=0.0), vehicles=2, until=1_200_000)
    for vehicle in swarm.vehicles:
        assert vehicle.made
        assert min(made.since for made in vehicle.made) >= 2 * CONTACT - TICK


def test_a_vehicle_that_counts_nobody_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The mutation: whoever is heard seems to be beyond the range."""
    monkeypatch.setattr(Vicinity, "beyond", lambda *_given: True)
    swarm, _ = flown(7, Rough(0.0, 60_000, reach=RANGE + 2.0))
    assert swarm.least() < swarm.d - EXACT
