"""Downwash: the laws of distances between plans hold in the ellipsoid; a ball is what it was, to the bit."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.noncooperative import NonCooperative, NonCooperativeVehicle
from companion.avoidance.certified.separating_planes import (
    Others,
    Planes,
    agreed_planes,
    apart,
    hull_distance,
    keeps,
    kept,
    planes,
)
from companion.config import CompanionConfig
from companion.config.planning import FieldConfig
from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import STEPS, curves, later, random_plan

SPARE = 0.01
seeds = st.integers(0, 2**32 - 1)
factors = st.sampled_from([1.5, 2.0, 3.0, 7.0])


def others(own: Array, other: Array, d: float, downwash: float | None) -> Others:
    """Return an agreement on two plans, and the same two as a pair that shares nothing."""
    agreed = (
        agreed_planes(own, other, d) if downwash is None else agreed_planes(own, other, d, downwash=downwash)
    )
    heights = None if downwash is None else np.array([1.0 / downwash])
    return Others(own[None], other[None], np.full((1, STEPS), d), heights, agreed=agreed[None])


def in_ellipsoid(points: Array, downwash: float) -> Array:
    """Return ``points`` (…, 3) with their heights divided."""
    found: Array = points / (1.0, 1.0, downwash)
    return found


def beside(rng: np.random.Generator, found: Planes, points: Array) -> Array:
    """Return control points (n, 3, 3) anywhere on the own side of every plane."""
    normals = found.normals[0][:, None]
    q = points + rng.normal(size=(STEPS, 3, 3)) * 10.0 ** rng.uniform(-2, 1)
    lacks = np.maximum(found.least[0] - (normals * q).sum(axis=-1), 0.0)
    result: Array = q + (lacks / np.square(normals).sum(axis=-1))[..., None] * normals
    return result


@given(seeds, factors)
def test_two_plans_that_keep_their_sides_are_apart_in_the_ellipsoid(seed: int, downwash: float) -> None:
    rng = np.random.default_rng(seed)
    d = float(rng.choice([0.3, 0.9, 2.5]))
    off = rng.normal(size=3) * 10.0 ** rng.uniform(-1, 0.7)
    points = [later(random_plan(rng, np.zeros(3))), later(random_plan(rng, off))]
    shift, none = float(rng.choice([0.0, 0.75])), np.empty((0, STEPS, 3, 3))
    sides = [
        planes(
            own,
            Others(
                none,
                none,
                np.empty((0, STEPS)),
                agreed=agreed_planes(own, other, d, downwash=downwash, shift=shift)[None],
            ),
            SPARE,
        )
        for own, other in zip(points, points[::-1], strict=True)
    ]
    assert np.array_equal(sides[0].normals, -sides[1].normals)
    assert all(kept(found, own) for found, own in zip(sides, points, strict=True))
    before = hull_distance(in_ellipsoid(points[0] - points[1], downwash))
    least = np.where(before > 0.0, np.minimum(before, d), 0.0)
    first, second = (beside(rng, found, own) for found, own in zip(sides, points, strict=True))
    for one, two in ((first, second), (first, points[1]), (points[0], second)):
        distance = np.linalg.norm(in_ellipsoid(curves(one) - curves(two), downwash), axis=-1)
        assert (distance >= least[:, None] - 1e-9).all()


@given(seeds)
def test_a_ball_gives_the_same_bits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    own, other = later(random_plan(rng, np.zeros(3))), later(random_plan(rng, rng.normal(size=3)))
    usual, ball = (planes(own, others(own, other, 0.9, one), SPARE) for one in (None, 1.0))
    assert all(map(np.array_equal, usual, ball))
    assert apart(own, other, 0.9) == apart(own, other, 0.9, downwash=1.0)


def test_one_above_another_must_be_further_away() -> None:
    rng = np.random.default_rng(3)
    below = later(random_plan(rng, np.zeros(3), speed=0.0, acceleration=0.0))
    for height, far in ((1.9, False), (2.1, True)):
        above = below + np.array((0.0, 0.0, height))
        assert apart(above, below, 1.0, downwash=2.0) is far
        assert apart(above, below, 1.0)
        # Half of the distance that is left may be given up, each: in height, the downwash times as much.
        rows = agreed_planes(above, below, 1.0, downwash=2.0)
        lower = above - np.array((0.0, 0.0, 0.04))
        assert keeps(lower, rows) is far
    assert not keeps(above - np.array((0.0, 0.0, 0.06)), rows)


def test_the_field_of_a_non_cooperative_vehicle_above_reaches_as_far_as_its_ellipsoid() -> None:
    """At a scaled distance of 1.26 m, with 1.09 m as the least one, it pushes down; as a ball it is far."""
    own = np.broadcast_to(np.array([0.0, 0.0, 5.0]), (STEPS, 3, 3))
    above = NonCooperativeVehicle(np.array([0.0, 0.0, 8.79]), np.zeros(3), 0.0, 1.09, upright=False)
    ball, ellipsoid = (
        NonCooperative(CompanionConfig(field=FieldConfig(downwash=w)), STEPS).field([above], own)
        for w in (1.0, 3.0)
    )
    assert (ball == 0.0).all()
    assert (ellipsoid[:, 2] < 0.0).all()
