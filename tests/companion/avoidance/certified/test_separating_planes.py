"""The planes of the proof: the best separating direction, the same for both sides, and what follows from
keeping to one's own side of it."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations
from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.separating_planes import (
    SHARE,
    Others,
    Planes,
    agreed_planes,
    hull_distance,
    keeps,
    kept,
    nearest,
    planes,
)
from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import STEPS, curves, later, random_plan

SPARE = 0.01
seeds = st.integers(0, 2**32 - 1)
shapes = st.sampled_from(["any", "point", "segment", "thin", "flat", "twice", "grid", "axis"])


def triangle(rng: np.random.Generator, shape: str) -> Array:
    """One (3, 3) of a kind, metres, with the origin outside or within."""
    t = rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-3, 1) + rng.normal(size=3) * 10.0 ** rng.uniform(-2, 1)
    if shape == "point":
        t[:] = t[0]
    elif shape == "segment":
        t[2] = t[0] + rng.uniform(-0.5, 1.5) * (t[1] - t[0])
    elif shape == "thin":
        t[2] = t[0] + rng.uniform() * (t[1] - t[0]) + rng.normal(size=3) * 10.0 ** rng.uniform(-12, -3)
    elif shape == "flat":
        t[:, 2] = 0.0
    elif shape == "twice":
        t[1] = t[rng.choice([0, 2])]
    elif shape == "grid":
        # The finest that plans on the wire differ by.
        t = 2e-5 * np.round(t * 10.0 ** rng.uniform(0, 3))
    elif shape == "axis":
        t = np.round(rng.uniform(-2, 2, (3, 3)))
    return t


def exact_distance(t: Array) -> float:
    """Of the origin from the hull of (3, 3), in fractions: the nearest point of every face that has one."""
    rows = [[Fraction(float(x)) for x in row] for row in t]
    best = min(_dot(row, row) for row in rows)
    for a, b in combinations(rows, 2):
        best = min([best, *_within([a, b])])
    return sqrt(min([best, *_within(rows)]))


def _within(points: list[list[Fraction]]) -> list[Fraction]:
    """The squared distance of the origin from the face through ``points``, if its foot is on the face."""
    base, sides = points[0], [[x - y for x, y in zip(p, points[0], strict=True)] for p in points[1:]]
    gram = [[_dot(u, v) for v in sides] for u in sides]
    right = [-_dot(u, base) for u in sides]
    if len(sides) == 1:
        determinant, tops = gram[0][0], right
    else:
        (a, b), (_, d) = gram
        determinant = a * d - b * b
        tops = [right[0] * d - b * right[1], a * right[1] - b * right[0]]
    if determinant == 0:
        return []
    shares = [top / determinant for top in tops]
    if min(shares) < 0 or sum(shares) > 1:
        return []
    foot = [x + _dot(shares, [side[k] for side in sides]) for k, x in enumerate(base)]
    return [_dot(foot, foot)]


def _dot(u: list[Fraction], v: list[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(u, v, strict=True)), Fraction(0))


@given(seeds, shapes)
def test_the_normal_is_the_support_direction(seed: int, shape: str) -> None:
    """No direction has the triangle further off than its nearest point is; the normal has it as far."""
    t = triangle(np.random.default_rng(seed), shape)
    c = nearest(t[None])[0]
    distance, size = exact_distance(t), float(np.abs(t).max())
    assert c @ c == pytest.approx(1.0, abs=1e-14)
    margin = float((t @ c).min())
    assert margin <= distance + 1e-14 * size
    assert max(margin, 0.0) >= distance - 1e-9 * size
    assert hull_distance(t[None])[0] == pytest.approx(max(margin, 0.0), abs=1e-15 * size)


@given(seeds, shapes)
def test_both_sides_have_the_same_plane_with_opposite_normals_bit_by_bit(seed: int, shape: str) -> None:
    t = triangle(np.random.default_rng(seed), shape)
    if exact_distance(t) > 1e-12 * np.abs(t).max():
        np.testing.assert_array_equal(nearest(-t[None]), -nearest(t[None]))


def test_rounding_never_chooses_one_direction_here_and_another_there() -> None:
    """Almost along an axis, where candidates are equal but for rounding."""
    rng, count = np.random.default_rng(1), 20_000
    places = np.zeros((count, 3))
    places[:, 0] = rng.uniform(0.5, 5.0, count)
    places[:, 1] = places[:, 0] * 10.0 ** rng.uniform(-10, -7, count)
    for axes in ((0, 1, 2), (2, 0, 1), (1, 2, 0)):
        points = np.repeat(places[:, None, axes], 3, axis=1)
        np.testing.assert_array_equal(nearest(-points), -nearest(points))


@given(seeds)
def test_a_plane_does_not_depend_on_the_other_rows(seed: int) -> None:
    """Each vehicle has its neighbours in another row, among others."""
    rng = np.random.default_rng(seed)
    many = np.stack([triangle(rng, "any") for _ in range(rng.integers(2, 40))])
    chosen = rng.permutation(len(many))[: rng.integers(1, len(many))]
    np.testing.assert_array_equal(nearest(many[chosen]), nearest(many)[chosen])


@pytest.mark.parametrize("spot", [0.0, 1e-300, 1e-20])
def test_where_nothing_separates_there_is_a_unit_vector_all_the_same(spot: float) -> None:
    around = np.array([[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]])
    for t in (np.full((3, 3), spot), around, spot * around):
        assert np.linalg.norm(nearest(t[None])[0]) == pytest.approx(1.0)


NOTHING = Others(*np.zeros((2, 0, STEPS, 3, 3)), np.zeros((0, STEPS)))


class Pair:
    """Two committed plans, and each one's planes about the other, which move with both of them.

    ``agreed``: both sides keep the distance; otherwise each keeps all of it.
    """

    def __init__(self, seed: int, *, agreed: bool = True, upright: bool = False) -> None:
        rng = self.rng = np.random.default_rng(seed)
        self.d = float(rng.choice([0.3, 0.9, 2.5]))
        apart = rng.normal(size=3) * 10.0 ** rng.uniform(-1, 0.7)
        self.points = [later(random_plan(rng, np.zeros(3))), later(random_plan(rng, apart))]
        self.upright, self.shift = upright, float(rng.choice([0.0, 0.75, 0.9]))
        sides = list(zip(self.points, self.points[::-1], strict=True))
        self.rows = [self._agreed(own, other) for own, other in sides]
        self.planes = [
            planes(
                own,
                NOTHING._replace(agreed=rows[None])
                if agreed
                else Others(own[None], other[None], np.full((1, STEPS), self.d)),
                SPARE,
                upright=upright,
            )
            for (own, other), rows in zip(sides, self.rows, strict=True)
        ]
        relative = self.points[0] - self.points[1]
        relative[..., 2] *= not upright
        gap = np.einsum("nk,nik->ni", self.planes[0].normals[0], relative)
        self.apart_now = hull_distance(relative) > 0.0
        self.least = np.where(self.apart_now[:, None], np.minimum(gap, self.d), -np.inf)
        """How far apart control points have to be along the normal (n, 3), where anything separates them."""

    def _agreed(self, own: Array, other: Array) -> Array:
        return agreed_planes(own, other, self.d, upright=self.upright, shift=self.shift)

    def drawn(self, side: int) -> Array:
        """Control points (n, 3, 3) anywhere on the own side of every plane."""
        p: Planes = self.planes[side]
        q = self.points[side] + self.rng.normal(size=(STEPS, 3, 3)) * 10.0 ** self.rng.uniform(-2, 1)
        lacks = np.maximum(p.least[0] - np.einsum("nk,nik->ni", p.normals[0], q), 0.0)
        result: Array = q + lacks[..., None] * p.normals[0][:, None]
        return result

    def check(self, first: Array, second: Array) -> None:
        along = np.einsum("nk,nik->ni", self.planes[0].normals[0], first - second)
        assert (along >= self.least - 1e-12).all()
        distance = np.linalg.norm(curves(first) - curves(second), axis=-1)
        # On a segment the least of its three counts.
        assert (distance >= self.least.min(axis=1, keepdims=True) - 1e-12).all()


@given(seeds, st.booleans())
def test_the_committed_plans_keep_to_their_sides(seed: int, upright: bool) -> None:
    pair = Pair(seed, upright=upright)
    for p, own in zip(pair.planes, pair.points, strict=True):
        assert kept(p, own)
        assert kept(p._replace(least=p.wanted), own)
        here = np.einsum("mnk,nik->mni", p.normals, own)
        assert not kept(p._replace(least=here + 1e-12), own)
        assert not kept(p, own * np.nan)
        assert (p.wanted >= p.least).all()
        assert (p.wanted <= p.least + SPARE + 1e-12).all()
    if upright:
        # Where nothing separates them any direction is as good.
        assert not pair.planes[0].normals[0, pair.apart_now, 2].any()


@given(seeds, st.booleans())
def test_two_new_plans_that_keep_to_their_sides_are_apart(seed: int, upright: bool) -> None:
    pair = Pair(seed, upright=upright)
    pair.check(pair.drawn(0), pair.drawn(1))


@given(seeds)
def test_a_new_plan_and_one_that_is_carried_on_are_apart(seed: int) -> None:
    pair = Pair(seed)
    pair.check(pair.drawn(0), pair.points[1])
    pair.check(pair.points[0], pair.drawn(1))
    pair.check(*pair.points)


@given(seeds)
def test_from_what_shares_nothing_the_own_side_keeps_it_all(seed: int) -> None:
    pair = Pair(seed, agreed=False)
    pair.check(pair.drawn(0), pair.points[1])


@given(seeds, st.booleans())
def test_a_plan_keeps_an_agreement_if_it_is_on_its_side_of_every_plane(seed: int, upright: bool) -> None:
    """The two plans of the agreement do, to the last bit, and any other that is drawn there."""
    pair = Pair(seed, upright=upright)
    for side in (0, 1):
        rows, p = pair.rows[side], pair.planes[side]
        assert keeps(pair.points[side], rows)
        inside = pair.drawn(side) + 1e-9 * p.normals[0][:, None]
        assert keeps(inside, rows)
        crossing = inside.copy()
        segment, point = pair.rng.integers(0, STEPS), pair.rng.integers(0, 3)
        normal = p.normals[0, segment]
        beyond = normal @ inside[segment, point] - p.least[0, segment, point] + 1e-6
        crossing[segment, point] -= beyond * normal
        assert not keeps(crossing, rows)


@given(seeds, st.booleans())
def test_planes_move_with_both_plans(seed: int, upright: bool) -> None:
    """Their shares of the room make one; of two that fly in a row the one behind has more."""
    pair = Pair(seed, upright=upright)
    mine, others = (rows[:, SHARE] for rows in pair.rows)
    np.testing.assert_allclose(mine + others, 1.0, rtol=0.0, atol=1e-15)
    assert ((mine >= 0.05) & (mine <= 0.95)).all()
    away, aside = np.array([50.0, 0.0, 0.0]), np.array([0.0, 50.0, 0.0])
    travel = np.linspace(0.0, 1.0, 3 * STEPS).reshape(STEPS, 3, 1)
    for way, share in ((away, 0.5 - 0.5 * pair.shift), (-away, 0.5 + 0.5 * pair.shift), (aside, 0.5)):
        flown = travel * way
        found = agreed_planes(
            flown + np.array([100.0, 0.0, 0.0]), flown, 1.0, upright=upright, shift=pair.shift
        )
        np.testing.assert_allclose(found[:, SHARE], share, rtol=0.0, atol=0.01)


@given(seeds)
def test_the_planes_of_an_agreement_do_not_depend_on_the_plan_that_is_replaced(seed: int) -> None:
    """So plans that are made later, each at another time, are apart while both keep the agreement."""
    pair = Pair(seed)
    pair.points = [pair.drawn(0), pair.drawn(1)]
    before = pair.planes
    old = Pair(seed)
    pair.planes = [
        planes(newest, NOTHING._replace(agreed=rows[None]), SPARE)
        for newest, rows in zip(pair.points, old.rows, strict=True)
    ]
    for now, then in zip(pair.planes, before, strict=True):
        np.testing.assert_array_equal(now.normals, then.normals)
        np.testing.assert_array_equal(now.least, then.least)
        assert (now.wanted >= now.least).all()
    pair.check(pair.drawn(0), pair.drawn(1))
