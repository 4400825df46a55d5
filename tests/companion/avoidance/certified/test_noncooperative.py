"""Those that share no plan: plans keep clear of what they may do, and yield to what they are likely to do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.committed import controls, resting
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.certified.margins import reachable
from companion.avoidance.certified.noncooperative import NonCooperative
from companion.avoidance.field.planner import standing
from companion.config import CompanionConfig
from companion.estimation.tracks import State
from companion.values.horizon import Array
from companion.world import View, World
from mavlink_bridge.messages import GlobalPosition, Source
from tests.companion.avoidance.certified.plans import EPOCH, STEPS
from tests.companion.avoidance.certified.rough import FLEET

OWN, OTHER = 11, 190
NOW = EPOCH
HERE = np.array([0.0, 0.0, 5.0])
angles = st.floats(0.0, 2.0 * np.pi)


def config(kind: str | None = None, **certified: float) -> CompanionConfig:
    moving = [] if kind is None else [{"system": OTHER, "kind": kind, "radius": 0.4}]
    given = {"noncooperative_speed": 3.0} | certified
    return CompanionConfig.model_validate(
        {"task": "goto", "avoidance": "certified", "moving": moving, "certified": given}
    )


def announced(
    world: World, place: Array, velocity: Array, link: str = "swarm", now: int = NOW, stamp: int = NOW // 1000
) -> None:
    """The other says where it is, and how fast; that arrives at ``now`` (µs) with ``stamp`` (µs)."""
    latitude, longitude, altitude = FLEET.to_geodetic(place)
    ned = (float(velocity[1]), float(velocity[0]), float(-velocity[2]))
    message = GlobalPosition(Source(OTHER, 1), stamp, latitude, longitude, altitude, 0.0, ned, None)
    world.receive(now, link, message)


def hovering(of: CompanionConfig, place: Array, velocity: Array) -> Array:
    """Where the next plan of one that hovers, and wants to, ends, with the other at ``place``."""
    flight, world = CertifiedFlight(of, Source(OWN, 195), FLEET), World(of, OWN, 10, FLEET)
    announced(world, place, velocity)
    flight.stand(NOW, HERE)
    flight.commitment.following = None
    assert flight.plan(NOW, standing(HERE), world, world.at(NOW))
    assert flight.commitment.following is not None
    return controls(flight.commitment.following)[-1, 2]


@given(angles, st.floats(2.5, 4.5), st.floats(0.8, 3.0))
def test_who_comes_straight_at_one_that_hovers_is_yielded_to(angle: float, far: float, speed: float) -> None:
    direction = np.array([np.cos(angle), np.sin(angle), 0.0])
    place = HERE + far * direction
    stayed = hovering(config(omega_field=0.0), place, -speed * direction)
    yielded = hovering(config(), place, -speed * direction)
    # The planes alone ask for nothing: the place is kept.
    assert np.linalg.norm(stayed - HERE) < 0.05
    assert (yielded - HERE) @ direction < -0.05


@given(angles, st.floats(15.0, 40.0))
def test_who_is_far_and_slow_changes_nothing(angle: float, far: float) -> None:
    direction = np.array([np.cos(angle), np.sin(angle), 0.0])
    ends = hovering(config(), HERE + far * direction, -0.2 * direction)
    assert np.linalg.norm(ends - HERE) < 0.01


@given(angles, st.floats(-4.0, 30.0))
def test_a_walking_post_is_as_near_at_every_height(angle: float, height: float) -> None:
    of = config("post")
    direction = np.array([np.cos(angle), np.sin(angle), 0.0])
    place = HERE + 4.0 * direction
    found = [hovering(of, place * (1, 1, 0) + (0, 0, z), -direction) for z in (5.0, height)]
    np.testing.assert_allclose(found[0], found[1], atol=1e-3)


def test_a_thing_is_where_it_says_and_a_vehicle_only_nearly() -> None:
    """Of a thing only the own margin counts and its size; a vehicle has a margin of its own."""
    least = []
    for of in (config("sphere"), config()):
        world = World(of, OWN, 10, FLEET)
        announced(world, HERE, np.zeros(3))
        strangers = NonCooperative(of, STEPS)
        least.append(strangers.seen(NOW + 200_000, frozenset(), world)[0].least)
    own = config().certified
    clock = 1e-6 * own.clock_us * np.linalg.norm(config().limits.v_max)
    sigma = own.sigmas * config().field.position_sigma
    assert np.isclose(least[0], 0.5 + 0.4 + own.tube + clock + sigma)
    assert np.isclose(least[1], 0.5 + 2.0 * (own.tube + clock) + np.sqrt(2.0) * sigma)


@pytest.mark.parametrize("acceleration", [1.0, 500.0])
@pytest.mark.parametrize("growth", [0, 500_000, 1_100_000])
def test_balls_grow_for_the_configured_time_and_move_on(growth: int, acceleration: float) -> None:
    """Afterwards they keep their radius and have the received velocity, also the balls about a place."""
    velocity = np.array([0.0, 2.0, 0.0])
    of = config(noncooperative_growth_us=growth, noncooperative_acceleration=acceleration)
    world = World(of, OWN, 10, FLEET)
    announced(world, HERE + np.array([50.0, 0.0, 0.0]), velocity)
    seeing, own = NonCooperative(of, STEPS), np.tile(HERE, (STEPS, 3, 1))
    ((centres, radii),) = seeing.balls(seeing.seen(NOW, frozenset(), world), own)
    step = 1e-6 * of.certified.dt_us
    grown = int(np.ceil(1e-6 * growth / step))
    grows = np.diff(radii) > 0.0
    assert grows[: max(grown - 1, 0)].all()
    assert not grows[max(grown - 1, 0) :].any()
    went = centres[grown:, 2] - centres[grown:, 0]
    np.testing.assert_allclose(went, np.tile(step * velocity, (STEPS - grown, 1)), atol=1e-3)


@pytest.mark.parametrize("sigma", [0.0, 1.0])
def test_a_vehicle_that_circles_is_expected_on_its_circle_if_its_turn_is_estimated(sigma: float) -> None:
    given = config().model_dump(mode="json") | {"neighbour": {"sigma_velocity": 0.02, "sigma_turn": sigma}}
    of = CompanionConfig.model_validate(given)
    world, seeing = World(of, OWN, 10, FLEET), NonCooperative(of, STEPS)
    radius, rate = 2.0, 0.5
    for k in range(61):
        ahead = np.array([np.cos(0.05 * k * rate), np.sin(0.05 * k * rate), 0.0])
        aside = np.array([-ahead[1], ahead[0], 0.0])
        now = NOW + 50_000 * k
        sent = {"now": now + of.neighbour.delay_us, "stamp": 100_000_000 + 50_000 * k}
        announced(world, HERE + radius * ahead, radius * rate * aside, **sent)
    (one,) = seeing.seen(now, frozenset(), world)
    assert one.turn_rate == pytest.approx(rate if sigma else 0.0, abs=0.05)
    ((centres, _),) = seeing.balls([one], np.tile(HERE + 50.0, (STEPS, 3, 1)))
    off = np.abs(np.linalg.norm(centres[:10, 2] - HERE, axis=1) - radius)
    assert (off.max() < 0.1) == bool(sigma)


def test_a_target_that_falls_silent_is_kept_clear_of_where_it_was_last() -> None:
    of = config().model_copy(update={"target_d_min": 1.0, "target_d_safe": 4.0})
    world, place = World(of, OWN, OTHER, FLEET), HERE + np.array([3.0, 0.0, 0.0])
    announced(world, place, np.zeros(3), "target")
    strangers, silence = NonCooperative(of, STEPS), 10 * of.guard.target_stale_us
    (received,), (silent,) = (
        strangers.target(now, now + 200_000, world.at(now)) for now in (NOW, NOW + silence)
    )
    assert world.at(NOW + silence).target is None
    for before, after in zip(received, silent, strict=True):
        np.testing.assert_allclose(after, before, atol=1e-6)
    np.testing.assert_allclose(silent[0], np.broadcast_to(place, (STEPS, 3, 3)), atol=0.02)


def test_a_member_is_no_stranger() -> None:
    world = World(config(), OWN, 10, FLEET)
    announced(world, HERE, np.zeros(3))
    strangers = NonCooperative(config(), STEPS)
    assert strangers.seen(NOW, frozenset({OTHER}), world) == []
    own = controls(resting(NOW, 200_000, STEPS, HERE, FLEET.fingerprint))
    assert (strangers.field([], own) == 0.0).all()


@given(st.integers(0, 999_999), st.floats(0.0, 8.0))
def test_the_target_is_where_it_will_be_whenever_in_an_epoch_it_is_asked_for(late: int, speed: float) -> None:
    """It is seen where it is then, and what is kept clear of begins with the next epoch."""
    of = CompanionConfig.model_validate(
        {"task": "goto", "avoidance": "certified", "target_d_min": 1.0, "target_d_safe": 3.0}
    )
    velocity = np.array([speed, 0.0, 0.0])
    seen = State(HERE + 1e-6 * late * velocity, velocity, 0)
    view = View(None, None, seen, None, seen)
    (centres, _), *others = NonCooperative(of, STEPS).target(NOW + late, NOW + 1_000_000, view)
    knots = 1.0 + 1e-6 * of.certified.dt_us * np.arange(STEPS)
    np.testing.assert_allclose(centres[:, 0], HERE + knots[:, None] * velocity, atol=1e-9)
    assert not others


@pytest.mark.parametrize("jump", [0.1, 0.7, 1.9, 3.0, 60.0, -5.0, -60.0])
@pytest.mark.parametrize("turn", [0.0, 1.0])
@pytest.mark.parametrize("hz", [4, 10])
def test_the_balls_hold_a_vehicle_whose_clock_begins_anew(jump: float, turn: float, hz: int) -> None:
    """At 5 m/s, with ``turn`` (m/s²); after ten seconds its stamps step back by ``jump`` seconds."""
    of, speed = config(noncooperative_speed=5.0, noncooperative_acceleration=1.0), 5.0
    world, seconds = World(of, OWN, 10, FLEET), np.array([0.0, 0.2])
    seeing, delay = NonCooperative(of, STEPS), of.neighbour.delay_us

    def true(t: float) -> tuple[Array, Array]:
        angle, radius = turn / speed * t, speed**2 / (turn or 1.0)
        if turn == 0.0:
            return np.array([speed * t, 0.0, 5.0]), np.array([speed, 0.0, 0.0])
        ahead = np.array([np.cos(angle), np.sin(angle), 0.0])
        return np.array([radius * ahead[1], radius * (1.0 - ahead[0]), 5.0]), speed * ahead

    for k in range(20 * hz):
        place, velocity = true(k / hz)
        sent = round(1e6 * k / hz)
        stamp = 100_000_000 + sent - (round(1e6 * jump) if k >= 10 * hz else 0)
        announced(world, place, velocity, now=NOW + sent + delay, stamp=stamp)
        for later in (0, round(4e5 / hz)):
            now = NOW + sent + delay + later
            apart = []
            for one in seeing.seen(now, frozenset(), world):
                centres, reach = reachable(one.position, one.velocity, one.age, seconds, 5.0, 1.0)
                off = centres[0, 1] - true(1e-6 * (now - NOW) + 0.1)[0]
                apart.append(float(np.linalg.norm(off)) - reach[0])
            assert min(apart) <= 0.05
