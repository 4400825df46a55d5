"""Balls about those that share no plan hold whatever they do within their bounds; margins add up."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.margins import between, from_surfaces, margin, reachable
from companion.config.certified import CertifiedConfig
from companion.config.planning import FieldConfig, LimitsConfig
from companion.estimation.turn_rate import turning_path
from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import curves

STEPS, DT, FINE = 8, 0.2, 20
SECONDS = DT * np.arange(STEPS + 1.0)
seeds = st.integers(0, 2**32 - 1)


def any_motion(rng: np.random.Generator, velocity: Array, age: float, speed: float, most: float) -> Array:
    """Places (n, FINE + 1, 3) on the segments of one that begins at the origin ``age`` s before the first of
    them, in some mood: straight away, back and forth, or anyhow."""
    mood, heading = rng.integers(0, 3), rng.normal(size=3)
    places, place = [], np.zeros(3)
    h = DT / FINE
    before = int(np.ceil(age / h))
    for step in range(before + STEPS * FINE + 1):
        if step >= before:
            places.append(place)
        if mood == 2 or (mood == 1 and step % 30 == 0):
            heading = rng.normal(size=3)
        wanted = velocity + (age / before if step < before else h) * most * heading / np.linalg.norm(heading)
        # To the nearest allowed speed: that asks for no more acceleration.
        after = wanted * min(1.0, speed / max(float(np.linalg.norm(wanted)), 1e-9))
        place = place + (age / before if step < before else h) * 0.5 * (velocity + after)
        velocity = after
    flown = np.array(places)
    return np.stack([flown[n * FINE : (n + 1) * FINE + 1] for n in range(STEPS)])


@given(seeds, st.floats(0.0, 3.0), st.sampled_from([0.3, 1.0, 5.0]), st.sampled_from([0.1, 1.0, 4.0]))
def test_the_balls_hold_every_motion_within_the_bounds(
    seed: int, age: float, speed: float, acceleration: float
) -> None:
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    velocity = rng.uniform() ** 0.3 * speed * direction / np.linalg.norm(direction)
    centres, radii = reachable(np.zeros(3), velocity, age, SECONDS, speed, acceleration)
    flown = any_motion(rng, velocity, age, speed, acceleration)
    off = np.linalg.norm(flown - curves(centres, FINE + 1), axis=-1)
    assert (off <= radii[:, None] + 1e-9).all()


@given(
    seeds,
    st.floats(0.0, 3.0),
    st.sampled_from([0.3, 1.0, 5.0]),
    st.sampled_from([0.1, 1.0, 4.0]),
    st.floats(0.0, DT * STEPS),
)
def test_the_balls_hold_a_vehicle_that_has_the_received_velocity_after_the_growth(
    seed: int, age: float, speed: float, acceleration: float, growth: float
) -> None:
    """Up to ``growth`` it moves anyhow within the bounds, from the next knot on as it was received."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    velocity = rng.uniform() ** 0.3 * speed * direction / np.linalg.norm(direction)
    centres, radii = reachable(np.zeros(3), velocity, age, SECONDS, speed, acceleration, growth)
    grown = int(np.searchsorted(SECONDS, growth - 1e-9))
    flown = any_motion(rng, velocity, age, speed, acceleration)
    later = DT / FINE * np.arange((STEPS - grown) * FINE + 1.0)
    begun = flown[grown, 0] if grown < STEPS else flown[-1, -1]
    keeps = begun + later[:, None] * velocity
    for n in range(grown, STEPS):
        flown[n] = keeps[(n - grown) * FINE : (n - grown + 1) * FINE + 1]
    off = np.linalg.norm(flown - curves(centres, FINE + 1), axis=-1)
    assert (off <= radii[:, None] + 1e-9).all()
    assert np.ptp(radii[max(grown - 1, 0) :]) <= 1e-12


@given(
    seeds,
    st.floats(0.0, 3.0),
    st.floats(-2.0, 2.0),
    st.sampled_from([0.1, 1.0, 4.0]),
    st.sampled_from([DT * STEPS, 0.5]),
)
def test_the_balls_of_a_turn_hold_who_turns_and_deviates(
    seed: int, age: float, rate: float, acceleration: float, growth: float
) -> None:
    """It turns at ``rate``, and accelerates in addition, up to the end of the growth."""
    rng = np.random.default_rng(seed)
    velocity = rng.normal(size=3)
    centres, radii = reachable(np.zeros(3), velocity, age, SECONDS, 100.0, acceleration, growth, rate)
    deviation = any_motion(rng, np.zeros(3), age, 100.0, acceleration)
    grown = int(np.searchsorted(SECONDS, growth - 1e-9))
    if grown < STEPS:
        deviation[grown:] = deviation[grown, 0]
    fine = age + np.add.outer(SECONDS[:-1], DT / FINE * np.arange(FINE + 1.0))
    arc = turning_path(np.zeros(3), velocity, rate, fine.ravel()).positions.reshape(*fine.shape, 3)
    off = np.linalg.norm(arc + deviation - curves(centres, FINE + 1), axis=-1)
    assert (off <= radii[:, None] + 1e-9).all()


def test_a_vehicle_that_turns_is_expected_on_the_circle() -> None:
    velocity, centre = np.array([0.0, 3.0, 0.0]), np.array([-3.0, 0.0, 0.0])
    centres, _ = reachable(np.zeros(3), velocity, 0.0, SECONDS, 3.0, 1e-3, turn_rate=1.0)
    np.testing.assert_allclose(np.linalg.norm(centres[:, ::2] - centre, axis=-1), 3.0, atol=1e-9)


def test_a_ball_about_the_last_position_moves_on_as_the_turn_does_after_the_growth() -> None:
    velocity, grown = np.array([0.0, 3.0, 0.0]), 4
    centres, radii = reachable(np.zeros(3), velocity, 0.0, SECONDS, 3.0, 100.0, SECONDS[grown], 1.0)
    arc = turning_path(np.zeros(3), velocity, 1.0, SECONDS).positions
    np.testing.assert_allclose(centres[1:grown], 0.0, atol=1e-12)
    assert (np.linalg.norm(arc[1 : grown + 1], axis=1) <= radii[:grown]).all()
    np.testing.assert_allclose(centres[grown:, 2], arc[grown + 1 :] - arc[grown], atol=1e-9)
    assert radii[grown:] == pytest.approx(3.0 * SECONDS[grown], abs=0.01)


@given(seeds, st.floats(0.0, 5.0))
def test_who_was_heard_longer_ago_may_be_further_off(seed: int, age: float) -> None:
    velocity = np.random.default_rng(seed).normal(size=3)
    radii = [reachable(np.zeros(3), velocity, a, SECONDS, 1.0, 1.0)[1] for a in (age, age + 0.1)]
    assert (radii[1] > radii[0]).all()
    assert (np.diff(radii[0]) > 0.0).all()
    assert (radii[0] <= age + SECONDS[1:]).all()


def distance(field: dict[str, float] | None = None, **settings: float) -> float:
    config = CertifiedConfig.model_validate({"tube": 0.2, "sigmas": 2.0, "clock_us": 2_000} | settings)
    given = FieldConfig.model_validate({"d_min": 0.5, "position_sigma": 0.1} | (field or {}))
    return between(config, given, LimitsConfig())


@pytest.mark.parametrize(
    "growing",
    [
        [distance(tube=tube) for tube in (0.01, 0.2, 1.0)],
        [distance(sigmas=sigmas) for sigmas in (0.0, 1.0, 3.0)],
        [distance(clock_us=clock) for clock in (0, 1_000, 50_000)],
        [distance({"position_sigma": sigma}) for sigma in (0.0, 0.02, 0.5)],
        [distance({"d_min": d}) for d in (0.2, 0.5, 2.0)],
    ],
    ids=["tube", "sigmas", "clock", "estimate", "d_min"],
)
def test_plans_are_further_apart_for_each_thing_that_may_be_off(growing: list[float]) -> None:
    assert all(less < more for less, more in pairwise(growing))


@given(st.floats(0.01, 2.0), st.floats(0.0, 6.0), st.floats(0.0, 1.0), st.integers(0, 100_000), seeds)
def test_plans_that_far_apart_leave_d_min_whatever_is_off(
    tube: float, sigmas: float, sigma: float, clock: int, seed: int
) -> None:
    """By tube, clock and k·σ of the estimate, each in full and in opposite directions."""
    config = CertifiedConfig(tube=tube, sigmas=sigmas, clock_us=clock)
    field, limits = FieldConfig(position_sigma=sigma), LimitsConfig()
    rng = np.random.default_rng(seed)
    aims = rng.normal(size=(6, 3)) - rng.choice([0.0, 5.0]) * np.array([1.0, 0.0, 0.0])
    ways = aims / np.linalg.norm(aims, axis=1, keepdims=True)
    late = 1e-6 * clock * np.array(limits.v_max)
    off = tube * (ways[0] + ways[1]) + np.linalg.norm(late) * (ways[2] + ways[3])
    off += sigmas * sigma * (ways[4] + ways[5])
    apart = np.array([between(config, field, limits), 0.0, 0.0]) + off
    assert np.linalg.norm(apart) >= field.d_min - 1e-9
    assert between(config, field, limits) == pytest.approx(field.d_min + 2.0 * margin(config, field, limits))


@given(st.floats(0.01, 2.0), st.floats(0.0, 1.0), st.floats(0.05, 2.0))
def test_plans_keep_the_own_margin_and_the_least_distance_of_obstacles(
    tube: float, sigma: float, least: float
) -> None:
    config, field, limits = CertifiedConfig(tube=tube), FieldConfig(position_sigma=sigma), LimitsConfig()
    off = margin(config, field, limits)
    assert from_surfaces(config, field, limits) == pytest.approx(field.d_min + off)
    other = config.model_copy(update={"d_min_obstacle": least})
    assert from_surfaces(other, field, limits) == pytest.approx(least + off)
    assert between(other, field, limits) == between(config, field, limits)
