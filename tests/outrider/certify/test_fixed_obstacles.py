"""The verdict on plans beside fixed obstacles, without a flight."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.box_planes import box_planes
from companion.avoidance.certified.committed import controls
from companion.config.obstacles import Box, Obstacle, Post, Sphere, Wall
from companion.obstacles.boxes import boxes_of
from companion.values.horizon import Array
from mavlink_bridge.wire.plan import Integers, WirePlan
from outrider.certify.evidence import Evidence, Order
from outrider.certify.fixed_obstacles import Kept
from outrider.certify.solids import Rows, Solids
from outrider.certify.verdict import Verdict, judge
from tests.outrider.certify.evidence import (
    ABOUT_AGREEMENTS,
    BEGAN,
    EPOCH,
    TERMS,
    accelerations,
    evidence,
    on,
    standing,
    turned,
)
from tests.outrider.certify.test_solids import longest, obstacles, sampled

SURFACE = 0.8
"""m from surfaces that plans keep."""
NEARER = "a plan nearer to a fixed obstacle than certified"
LANDING = "a landing too near a fixed obstacle"
A = standing((0.0, 0.0, 5.0))
_COUNT = 201


def going(metres: float) -> list[Integers]:
    """Accelerations of a way of 2.4 s and so many metres to the east."""
    most = round(1000 * metres)
    return [(most, 0, 0)] * 5 + [(-most, 0, 0)] * 5


def moved(plan: WirePlan, metres: float) -> WirePlan:
    """The plan made after ``plan``, which rests: ``metres`` to the east."""
    return turned(on(plan), going(metres))


def rested(plan: WirePlan) -> WirePlan:
    """The same, carried on until it rests."""
    return on(plan, len(plan.accelerations))


def flown(plans: Sequence[WirePlan], known: Sequence[Obstacle], orders: Sequence[Order] = ()) -> Evidence:
    """``plans`` of 11, which knows the obstacles."""
    terms = TERMS._replace(fleet=(11,), surface=SURFACE)
    whole = evidence({11: plans}, terms)
    logs = tuple(log._replace(orders=tuple(orders)) for log in whole.logs)
    return whole._replace(logs=logs, obstacles={11: tuple(known)})


def judged(whole: Evidence) -> Verdict:
    """The verdict, but for what is found about agreements and reservations."""
    verdict = judge(whole)
    others = {*ABOUT_AGREEMENTS, "a descent without a reservation", "a climb without a reservation"}
    left = tuple(finding for finding in verdict.findings if finding.what not in others)
    return verdict._replace(findings=left)


def post(x: float, y: float = 0.0, **changes: float) -> Post:
    return Post(kind="post", at=(x, y), radius=0.5, **changes)


def box(x: float, y: float = 0.0, z: float = 5.0) -> Box:
    return Box(kind="box", at=(x, y, z), size=(1.0, 1.0, 1.0))


SHAPES = [
    post(2.0),
    box(2.0),
    Sphere(kind="sphere", at=(2.0, 0.0, 5.0), radius=0.5),
    Wall(kind="wall", ends=((2.0, -3.0), (2.0, 3.0)), thickness=1.0),
]
"""Each has its surface 1.5 m east of ``A``."""


@pytest.mark.parametrize("known", SHAPES, ids=lambda one: one.kind)
@pytest.mark.parametrize(("metres", "near"), [(0.69, False), (0.71, True)])
def test_a_plan_nearer_than_required_is_found(known: Obstacle, metres: float, near: bool) -> None:
    plan = moved(A, metres)
    verdict = judged(flown([A, plan, on(plan), on(plan, 2)], [box(-50.0), known]))
    document = verdict.document()
    assert document["least_to_obstacle_m"] == pytest.approx(1.5 - metres, abs=1e-3)
    assert document["required_to_obstacle_m"] == SURFACE
    assert [(one.what, one.who) for one in verdict.findings] == ([(NEARER, (11,))] if near else [])
    for one in verdict.findings:
        # Where the plan comes to rest.
        assert 2.0e6 <= one.time - plan.epoch <= 2.0e6 + 1e5
        assert f"obstacles[1], a {known.kind} " in one.figures
        assert "0.79" in one.figures
        assert "at least 0.800000 m; in 1 plans" in one.figures


def test_the_middle_of_a_plan_counts() -> None:
    """It passes a corner at a distance that neither its ends nor its control points show alone."""
    known = [post(0.5, 1.25)]
    plan = moved(A, 1.0)
    verdict = judged(flown([A, plan], known))
    assert [one.what for one in verdict.findings] == [NEARER]
    assert judged(flown([A, moved(A, 0.1)], known)).certified
    # Control points may be nearer than their curve, which alone counts.
    first, last = (300, 800, 0), (300, -800, 0)
    bent = turned(on(A), [first, last, (-300, 800, 0)])
    for y in np.linspace(0.55, 1.4, 30).tolist():
        near = sampled(controls(bent), post(0.02, y), 4001) < min(
            SURFACE, sampled(controls(A), post(0.02, y))
        )
        assert judged(flown([A, bent], [post(0.02, y)])).certified is not near


@given(accelerations, obstacles, st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_a_finding_is_what_dense_samples_show(
    turns: list[Integers], known: Obstacle, place: tuple[float, float, float]
) -> None:
    begin = standing(place)
    plan = turned(on(begin), turns)
    verdict = judged(flown([begin, plan], [known]))
    bound = min(SURFACE, sampled(controls(begin), known, 2))
    points = controls(plan)
    least, step = sampled(points, known, _COUNT), longest(points) / (_COUNT - 1)
    if any(one.what == NEARER for one in verdict.findings):
        assert least < bound + step
    else:
        assert least > bound - 2e-6


def test_who_began_nearer_may_not_come_nearer() -> None:
    """It stands 0.5 m from the box; once it was 0.7 m away it may not return, and at last keeps 0.8 m."""
    begin = standing((1.0, 0.0, 5.0))
    for changes, found in (([], 0), ([-0.1], 0), ([0.01], 1), ([-0.2, 0.1], 1), ([-0.5, 0.21], 1)):
        plans = [begin]
        for metres in changes:
            plans.append(moved(rested(plans[-1]), metres))
        verdict = judged(flown(plans, [box(2.0)]))
        assert len(verdict.findings) == found, changes


def test_who_began_inside_may_not_come_deeper() -> None:
    """It stands 0.2 m deep in a box of 1 m; from where it has come out it may not return."""
    begin = standing((1.7, 0.0, 5.0))
    changes = ([], 0), ([-0.1], 0), ([0.1], 1), ([-0.5], 0), ([-0.5, 0.1], 1), ([1.5], 1), ([-0.1, 0.05], 1)
    for moves, found in changes:
        plans = [begin]
        for metres in moves:
            plans.append(moved(rested(plans[-1]), metres))
        findings = judged(flown(plans, [box(2.0)])).findings
        assert [one.what for one in findings] == [NEARER] * found, moves


def test_who_began_round_a_corner_may_not_come_deeper() -> None:
    """It turns back 0.05 m before a box; a control point is 0.05 m inside, so the bound is negative."""
    begin = turned(standing((0.15, 0.0, 5.0)), [(10_000, 0, 0), (-20_000, 0, 0), (10_000, 0, 0)])
    for made, found in ((on(begin), []), (turned(on(begin), [(-5_000, 0, 0), (-5_000, 0, 0)]), [NEARER])):
        findings = judged(flown([begin, made], [box(1.0)])).findings
        near = [one for one in findings if one.what == NEARER]
        assert [one.what for one in near] == found
        assert all("-0.250000 m, at least -0.050000 m" in one.figures for one in near)


@given(
    st.lists(st.tuples(*[st.floats(-1.5, 1.5)] * 3), min_size=3, max_size=3),
    st.tuples(*[st.floats(0.1, 2.0)] * 3),
    st.floats(-180.0, 180.0),
)
def test_a_bound_asks_no_more_of_a_plan_than_planes_of_boxes_keep(
    triangle: list[tuple[float, ...]], size: tuple[float, float, float], yaw: float
) -> None:
    """Inside and outside: a plan that keeps min c·q_i of the committed one is no deeper than its bound."""
    known = Box(kind="box", at=(0.0, 0.0, 0.0), size=size, yaw_deg=yaw)
    own = np.array([triangle])
    bound = Solids([known]).least(own, np.array([0]), 100.0).hull[0]
    normals, least, _ = box_planes(own, boxes_of([known]), 100.0, 0.0)
    (c,), cos, sin = normals[0], np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    along = np.abs([cos * c[0] + sin * c[1], cos * c[1] - sin * c[0], c[2]])
    assert bound <= least[0, 0].min() - 0.5 * along @ size + 1e-9


def test_after_an_anchor_the_bound_begins_anew() -> None:
    """Planning restarts 0.5 m from the box; then it may not come nearer."""
    anchor = standing((1.0, 0.0, 5.0), BEGAN + EPOCH)
    whole = flown([A, anchor, on(anchor)], [box(2.0)])
    assert NEARER not in [one.what for one in judged(whole).findings]
    nearer = moved(anchor, 0.1)
    whole = flown([A, anchor, nearer], [box(2.0)])
    (finding,) = (one for one in judged(whole).findings if one.what == NEARER)
    assert "at least 0.500" in finding.figures


def test_each_vehicle_has_its_own_obstacles() -> None:
    plan = moved(A, 1.0)
    whole = flown([A, plan], [])
    assert judged(whole._replace(obstacles={12: (box(2.0),)})).certified
    assert not judged(whole._replace(obstacles={11: (box(2.0),)})).certified


# Columns


@pytest.mark.parametrize(
    ("known", "found"),
    [
        (box(0.0, 1.2, 0.5), True),
        (box(0.0, 1.4, 0.5), False),
        (box(0.0, 0.0, 7.0), False),
        (Sphere(kind="sphere", at=(0.9, 0.0, 0.5), radius=0.5), True),
        (post(0.9, height=1.0), True),
        (post(1.4, height=1.0), False),
    ],
)
def test_a_landing_above_or_beside_an_obstacle_is_found(known: Obstacle, found: bool) -> None:
    """What is beside the way down, however far below; what is overhead is out of its way."""
    column = A._replace(column=True)
    plans = [column, on(column), on(column, 2)]
    land = Order(BEGAN + EPOCH + 1000, False, 100)
    verdict = judged(flown(plans, [known], [land]))
    assert [one.what for one in verdict.findings] == ([LANDING] if found else [])
    for one in verdict.findings:
        assert one.time == land.time
        assert "obstacles[0], a" in one.figures


def test_a_climb_has_no_planned_height_and_what_follows_begins_anew() -> None:
    """The autopilot brings it to 0.5 m beside the box; from there its plans may not come nearer."""
    ground = standing((1.0, 0.0, 0.0))._replace(column=True)
    climb = Order(BEGAN + EPOCH + 1000, True, 100)
    air = on(ground, 3).at_height(5.0)
    plans = [ground, on(ground), on(ground, 2), air]
    assert NEARER not in [one.what for one in judged(flown(plans, [box(2.0)], [climb])).findings]
    found = judged(flown([*plans, moved(air, 0.1)], [box(2.0)], [climb])).findings
    assert NEARER in [one.what for one in found]


# Many obstacles


def test_of_thousands_of_boxes_only_those_near_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    measured: list[int] = []
    least, near = Solids.least, Solids.near
    searches: list[int] = []

    def spied(self: Solids, points: Array, of: Rows, within: float) -> object:
        measured.append(len(of))
        return least(self, points, of, within)

    def searched(self: Solids, low: Array, high: Array, within: float) -> Rows:
        searches.append(1)
        return near(self, low, high, within)

    monkeypatch.setattr(Solids, "least", spied)
    monkeypatch.setattr(Solids, "near", searched)
    known = [box(4.0 * (k % 100) - 200.0, 4.0 * (k // 100) - 78.0) for k in range(4000)]
    plans = [standing((-198.0, 0.0, 5.0))]
    for _ in range(8):
        plans.append(moved(rested(plans[-1]), 1.0))
    verdict = judged(flown(plans, known))
    assert verdict.certified
    assert len(measured) == 9
    # Within 10 m of the region: boxes every 4 m.
    assert max(measured) < 60
    assert len(searches) == 1
    assert 0 < verdict.fixed.checked < 9 * 12


def test_without_obstacles_nothing_is_checked() -> None:
    verdict = judged(flown([A, moved(A, 1.0)], []))
    assert verdict.fixed == Kept(0, None, [])
    assert verdict.document()["least_to_obstacle"] is None
