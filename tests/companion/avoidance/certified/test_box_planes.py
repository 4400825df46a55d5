"""Planes between plans and boxes: a plan that keeps its rows is clear, and the committed one keeps them."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from companion.avoidance.certified.box_planes import box_planes
from companion.avoidance.certified.separating_planes import Others, kept, planes
from companion.values.boxes import Boxes, distances
from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import EPOCH, STEPS, curves, later, random_plan
from tests.companion.avoidance.certified.test_commitment import LENGTH, NOBODY, commitment, replan
from tests.companion.values.test_boxes import drawn, world

SPARE = 0.01
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
HERE = np.array([0.0, 0.0, 5.0])


def triangles(rng: np.random.Generator, count: int) -> Array:
    """Segments (count, 3, 3) about the boxes: points, lines, thin and wide ones."""
    found = rng.uniform(-10.0, 10.0, (count, 1, 3)) + rng.normal(size=(count, 3, 3)) * 10.0 ** rng.uniform(
        -3, 0.5, (count, 1, 1)
    )
    found[::5] = found[::5, :1]
    found[1::5, 2] = 0.5 * (found[1::5, 0] + found[1::5, 1])
    found[2::5, :, 2] = found[2::5, :1, 2]
    return found


def inside(points: Array, count: int) -> Array:
    """Places (k, n, 3) in the hulls of (k, 3, 3), on a fine grid with the corners."""
    steps = [(i, j) for i in range(count + 1) for j in range(count + 1 - i)]
    weights = np.array([(i, j, count - i - j) for i, j in steps]) / count
    return np.asarray(weights @ points)


@pytest.mark.parametrize("seed", range(10))
def test_any_plan_that_keeps_the_rows_is_the_distance_from_the_box(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes, d = drawn(rng, 8), float(rng.uniform(0.1, 2.0))
    own = triangles(rng, 60)
    normals, least, wanted = box_planes(own, boxes, d, SPARE)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=1e-12)
    assert (wanted >= least).all()
    for k in range(8):
        support = (world(boxes, k, CORNERS * boxes.halves[k]) @ normals[k].T).max(axis=0)
        full = np.isclose(least[k], support[:, None] + d).all(axis=1)
        assert full.any()
        # Control points anywhere on their side of the plane, most of them right at it.
        new = own + rng.normal(size=own.shape)
        short = least[k] - np.einsum("nk,nik->ni", normals[k], new)
        new += (
            np.where(short > 0.0, short, short * rng.choice([0.0, 1.0], short.shape))[..., None]
            * (normals[k][:, None])
        )
        assert distances(inside(new[full], 6), boxes)[..., k].min() >= d - 1e-9


@pytest.mark.parametrize("seed", range(10))
def test_the_committed_plan_keeps_its_rows_to_the_last_bit_wherever_it_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    own = triangles(rng, 60)
    boxes = drawn(rng, 20)
    for upright in (False, True):
        none = Others(*np.zeros((2, 0, 60, 3, 3)), np.zeros((0, 60)))
        found = planes(own, none._replace(boxes=boxes, from_boxes=0.7), SPARE, upright=upright)
        assert kept(found, own)
        assert (np.einsum("mnk,nik->mni", found.normals, own) >= found.wanted - 1e-12).all()
        if upright:
            assert (found.normals[..., 2] == 0.0).all()


@pytest.mark.parametrize("seed", range(10))
def test_a_plan_that_is_clear_of_a_box_is_asked_for_the_whole_distance(seed: int) -> None:
    """The room that the planes show is the distance of the two bodies."""
    rng = np.random.default_rng(100 + seed)
    own, boxes = triangles(rng, 40), drawn(rng, 10)
    normals, _, _ = box_planes(own, boxes, 0.5, 0.0)
    across = np.einsum("mnk,nik->mni", normals, own).min(axis=-1)
    corners = np.stack([world(boxes, k, CORNERS * boxes.halves[k]) for k in range(10)])
    room = across - np.einsum("mnk,mck->mnc", normals, corners).max(axis=-1)
    size = np.linalg.norm(own[:, 1:] - own[:, :1], axis=-1).max(axis=-1)
    sampled = distances(inside(own, 40), boxes).min(axis=1).T
    apart = sampled > 0.0
    assert (room <= sampled + 1e-9)[apart].all()
    assert (room >= sampled - size / 40.0 - 1e-9)[apart & (sampled > size / 40.0)].all()


@pytest.mark.parametrize("seed", range(10))
def test_where_heights_do_not_count_the_distance_is_that_seen_from_above(seed: int) -> None:
    rng = np.random.default_rng(seed)
    own, boxes = triangles(rng, 40), drawn(rng, 6)
    flat = own.copy()
    flat[..., 2] = 0.0
    tall = boxes._replace(
        centres=boxes.centres * (1.0, 1.0, 0.0), halves=np.where([0, 0, 1], 1e3, boxes.halves)
    )
    found, expected = box_planes(own, boxes, 0.5, SPARE, upright=True), box_planes(flat, tall, 0.5, SPARE)
    clear = distances(inside(flat, 20), tall).min(axis=1).T > 0.3
    for one, two in zip(found, expected, strict=True):
        np.testing.assert_allclose(one[clear], two[clear], atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_from_epoch_to_epoch_a_plan_that_begins_clear_stays_clear_whatever_its_goal(seed: int) -> None:
    """Solved, rounded and checked plans towards goals behind and inside the boxes."""
    rng = np.random.default_rng(seed)
    kept_plan, d, now = commitment(), 0.6, EPOCH
    boxes = drawn(rng, 40, room=6.0)
    boxes.centres[:, 2] += 5.0
    boxes = boxes.chosen(np.flatnonzero(distances(HERE, boxes) > d + 0.05))
    assert len(boxes.centres) > 5
    others = NOBODY._replace(boxes=boxes, from_boxes=d)
    goal, least, solved = HERE, np.inf, 0
    for epoch in range(15):
        now += LENGTH
        goal = rng.uniform(-5.0, 5.0, 3) + HERE if epoch % 5 == 0 else goal
        if kept_plan.turn(now):
            solved += replan(kept_plan, goal, others)
        least = min(least, distances(curves(kept_plan.own()).reshape(-1, 3), boxes).min())
    assert least >= d
    assert least < d + 0.2
    assert solved >= 12


def test_rows_of_boxes_have_forces_of_their_own_and_do_not_move() -> None:
    """A wall beside the way to a goal behind it pushes the plan back, along its normal."""
    kept_plan = commitment()
    wall = Boxes(HERE[None] + (2.0, 0.0, 0.0), np.array([[0.1, 5.0, 5.0]]), np.array([[1.0, 0.0]]))
    others = NOBODY._replace(boxes=wall, from_boxes=0.5)
    for epoch in range(1, 12):
        if kept_plan.turn(EPOCH + epoch * LENGTH):
            replan(kept_plan, HERE + np.array([4.0, 0.0, 0.0]), others)
    rest = kept_plan.own()[-1, 2]
    assert rest[0] == pytest.approx(1.4, abs=0.02)
    assert rest[1:] == pytest.approx(HERE[1:], abs=1e-2)


def test_random_plans_near_boxes_have_finite_rows() -> None:
    rng = np.random.default_rng(3)
    boxes = drawn(rng, 30, room=3.0)
    for _ in range(20):
        own = later(random_plan(rng, rng.normal(size=3)))
        assert all(np.isfinite(part).all() for part in box_planes(own, boxes, 0.5, SPARE))
        assert own.shape == (STEPS, 3, 3)
