"""The repulsive field: shape of the magnitude, direction, symmetries, what motion adds to it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.field.forces import magnitude, repulsion, stopping_distance
from companion.values.vectors import limit
from tests.companion.rig import LAWS, numbers, obstacles, rotations, vectors

GAIN, CLAMP, BRAKING, DT = 10.0, 7.0, 4.0, 0.1
D_MIN, D_SAFE = np.array(0.5), np.array(3.0)
BRAKINGS = st.sampled_from([None, BRAKING])


def force_at(distance, gain=GAIN, clamp=CLAMP, d_min=D_MIN, d_safe=D_SAFE):
    return magnitude(
        np.atleast_1d(np.asarray(distance, dtype=float)), np.asarray(d_min), np.asarray(d_safe), gain, clamp
    )


def push(own, others, braking=BRAKING):
    return repulsion(own, others, GAIN, CLAMP, braking, DT)


def paths(count=16):
    """Smooth predicted positions (count, 3) of a vehicle under way."""
    ahead = DT * np.arange(count)[:, None]
    return st.tuples(vectors(5.0), vectors(5.0)).map(lambda state: state[0] + ahead * state[1])


@LAWS
@given(
    gain=numbers(0.1, 100.0),
    clamp=numbers(0.5, 30.0),
    d_min=numbers(0.1, 2.0),
    width=numbers(0.2, 10.0),
)
def test_the_magnitude_is_continuous_and_falls_from_the_clamp_to_zero(gain, clamp, d_min, width):
    d_safe = d_min + width
    distance = np.linspace(0.0, d_safe + 1.0, 4001)
    force = force_at(distance, gain, clamp, d_min, d_safe)
    assert (force >= 0.0).all()
    assert (force <= clamp).all()
    assert (np.diff(force) <= 1e-12).all()
    assert (force[distance <= d_min] == clamp).all()
    assert (force[distance >= d_safe] == 0.0).all()
    # |F'| = K (π/2w)² cot² z is greatest where F reaches the clamp; cot z ≤ F · 2w/(πK) + π/2 there.
    steepest = gain * (math.pi / (2 * width)) ** 2 * (clamp * 2 * width / (math.pi * gain) + math.pi / 2) ** 2
    step = distance[1] - distance[0]
    assert np.abs(np.diff(force)).max() <= steepest * step * (1 + 1e-6) + 1e-9


@LAWS
@given(gain=numbers(0.1, 100.0), width=numbers(0.2, 10.0))
def test_the_magnitude_leaves_zero_at_d_safe_without_a_kink(gain, width):
    d_safe = 0.5 + width
    for share in (1e-2, 1e-3):
        # cot z + z − π/2 ≈ ε³/3 near z = π/2 − ε.
        epsilon = 0.5 * math.pi * share
        force = force_at(d_safe - share * width, gain, 1e9, 0.5, d_safe)[0]
        assert force == pytest.approx(gain * math.pi / (2 * width) * epsilon**3 / 3, rel=1e-3)


def test_the_magnitude_is_the_papers_in_between():
    # z = π/4 halfway between d_min and d_safe: cot z + z − π/2 = 1 − π/4.
    assert force_at(1.75)[0] == pytest.approx(GAIN * (math.pi / 5.0) * (1.0 - math.pi / 4.0))
    # Where F reaches 2 m/s² for three gains, read off the formula by hand.
    for gain, distance in ((1.0, 0.85), (10.0, 1.61), (50.0, 2.12)):
        assert force_at(distance, gain)[0] == pytest.approx(2.0, abs=0.1)


@LAWS
@given(own=paths(), place=vectors(8.0), velocity=vectors(5.0), braking=BRAKINGS)
def test_one_obstacle_pushes_straight_away_from_itself(own, place, velocity, braking):
    other = obstacles([place], [velocity])
    away = own - other.positions[0]
    distance = np.linalg.norm(away, axis=1)
    force = push(own, other, braking)
    far = distance > 1e-3
    norm = np.linalg.norm(force, axis=1)
    assert (norm <= CLAMP + 1e-9).all()
    along = np.einsum("ni,ni->n", force, away)[far] / distance[far]
    np.testing.assert_allclose(along, norm[far], atol=1e-9)


@LAWS
@given(own=paths(), places=st.lists(vectors(6.0), min_size=1, max_size=5), turn=rotations(), braking=BRAKINGS)
def test_rotating_the_world_rotates_the_force(own, places, turn, braking):
    others = obstacles(places)
    turned = others._replace(positions=others.positions @ turn.T)
    away = own - others.positions
    if np.linalg.norm(away, axis=2).min() < 1e-3:
        return
    expected = push(own, others, braking) @ turn.T
    # Near d_min F is as steep as 1/d²: rounding of the distance is amplified.
    np.testing.assert_allclose(push(own @ turn.T, turned, braking), expected, atol=1e-6)


@LAWS
@given(own=paths(), places=st.lists(vectors(6.0), min_size=2, max_size=6), data=st.data(), braking=BRAKINGS)
def test_the_order_of_obstacles_does_not_matter_and_forces_add(own, places, data, braking):
    others = obstacles(places)
    order = data.draw(st.permutations(range(len(places))))
    shuffled = obstacles([places[k] for k in order])
    force = push(own, others, braking)
    np.testing.assert_allclose(push(own, shuffled, braking), force, atol=1e-9)
    parts = sum(push(own, obstacles([place]), braking) for place in places)
    np.testing.assert_allclose(parts, force, atol=1e-9)


@LAWS
@given(own=paths(), braking=BRAKINGS, offset=numbers(0.0, 1e-7))
def test_coincident_centres_give_a_finite_force_at_the_clamp(own, braking, offset):
    other = obstacles([own[0]], [(own[1] - own[0]) / DT])
    force = push(own + np.array([0.0, offset, 0.0]), other, braking)
    assert np.isfinite(force).all()
    np.testing.assert_allclose(np.linalg.norm(force, axis=1), CLAMP, rtol=1e-6)


def test_nobody_around_means_no_force():
    own = np.zeros((16, 3))
    assert not push(own, obstacles([])).any()
    assert not push(own, obstacles([[3.0, 0.0, 0.0], [0.0, 40.0, 0.0]])).any()


@LAWS
@given(own=paths(), places=st.lists(vectors(6.0), min_size=1, max_size=4), velocity=vectors(5.0))
def test_the_bare_field_sees_distances_only(own, places, velocity):
    """Without ``braking`` the force at n depends on the positions at n, whatever comes before and after."""
    others = obstacles(places, [velocity] * len(places))
    force = push(own, others, None)
    for n in (0, 7, 15):
        frozen = others._replace(positions=np.repeat(others.positions[:, n : n + 1], 16, axis=1))
        held = np.repeat(own[n : n + 1], 16, axis=0)
        np.testing.assert_allclose(push(held, frozen, None)[n], force[n], atol=1e-12)


@LAWS
@given(place=vectors(4.0).filter(lambda place: np.linalg.norm(place) > 1e-3), velocity=vectors(5.0))
def test_a_common_velocity_changes_nothing_closing_adds_and_opening_takes_away(place, velocity):
    ahead = DT * np.arange(16)[:, None]
    still = push(np.zeros((16, 3)), obstacles([place]))
    np.testing.assert_allclose(push(ahead * velocity, obstacles([place], [velocity])), still, atol=1e-6)
    np.testing.assert_allclose(push(np.zeros((16, 3)), obstacles([place]), None), still, atol=1e-12)
    own = ahead * velocity
    norms = [np.linalg.norm(push(own, obstacles([place]), braking), axis=1) for braking in (None, BRAKING)]
    distance = np.linalg.norm(own - place, axis=1)
    grows = np.diff(distance, append=2.0 * distance[-1] - distance[-2]) > 0.0
    assert (norms[1] >= norms[0] - 1e-9)[~grows].all()
    assert (norms[1] <= norms[0] + 1e-9)[grows].all()
    # Within d_min nothing is taken away.
    assert (norms[1] >= norms[0] - 1e-9)[distance <= D_MIN].all()


@LAWS
@given(speed=numbers(0.0, 10.0), braking=numbers(0.5, 20.0), reaction=numbers(0.0, 1.0))
def test_the_stopping_distance_is_that_of_uniform_braking_after_the_reaction(speed, braking, reaction):
    """A vehicle that moves away has the same distance to spare."""
    for sign in (1.0, -1.0):
        expected = sign * (speed**2 / (2 * braking) + reaction * speed)
        assert stopping_distance(sign * speed, braking, reaction) == pytest.approx(expected, abs=1e-9)


@LAWS
@given(force=st.lists(vectors(50.0), min_size=1, max_size=16).map(np.array), bound=numbers(0.1, 20.0))
def test_limit_keeps_directions_and_never_exceeds_the_bound(force, bound):
    limited = limit(force, bound)
    before, after = np.linalg.norm(force, axis=1), np.linalg.norm(limited, axis=1)
    np.testing.assert_allclose(after, np.minimum(before, bound), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(np.cross(limited, force), 0.0, atol=1e-6)
    assert (np.einsum("ni,ni->n", limited, force) >= 0.0).all()


@LAWS
@given(offset=vectors(2.0), downwash=numbers(1.0, 5.0))
def test_with_downwash_the_force_is_a_gradient_of_the_distance_in_the_ellipsoid(offset, downwash):
    """At rest: F(d) along (Δx, Δy, Δz/w²)/d, so twice as high is as near as once beside for w = 2."""
    scale = np.array((1.0, 1.0, 1.0 / downwash))
    distance = float(np.linalg.norm(scale * offset))
    if distance < 1e-3:
        return
    own = np.broadcast_to(offset, (16, 3))
    there = obstacles(np.zeros((1, 3)))._replace(heights=np.array([1.0 / downwash]))
    expected = force_at(distance)[0] * scale**2 * offset / distance
    np.testing.assert_allclose(push(own, there)[0], expected, atol=1e-9)
