"""The planner as a whole: symmetries of space and time, determinism, and flights of point masses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.field.planner import Aim, Planner, standing
from companion.config import CompanionConfig
from companion.obstacles.static import FIRST_ID
from tests.companion.rig import QUICK, ZERO, fly, obstacles, ring

CONFIG = CompanionConfig()
START = 1_767_225_600_000_000
DT = CONFIG.horizon.dt_us
SEEDS = st.integers(0, 2**32 - 1)
EAST = np.array([1.0, 0.0, 0.0])
MIRROR = np.diag([1.0, -1.0, 1.0])
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def configured(**settings):
    return CompanionConfig.model_validate(settings)


def sense(name):
    return configured(turning_sense=name)


def encounter(seed, config, matrix=None, epoch=START, count=12):
    """A vehicle on its way through three others under way, planned anew every step: the plans."""
    M = np.eye(3) if matrix is None else matrix
    random = np.random.default_rng(seed)
    x = np.append(random.uniform(-6, 6, 2), 6.0)
    v = random.uniform(-2, 2, 3) * [1.0, 1.0, 0.3]
    goal, speed, target = random.uniform(-8, 8, 2), random.uniform(-1, 1, 3), random.uniform(-3, 3, 3)
    aim = Aim(M @ np.append(goal, 6.5), M @ speed, M @ target, M @ (target + 1.6 * speed))
    places, speeds = x + random.uniform(-4, 4, (3, 3)), random.uniform(-2, 2, (3, 3))
    planner, plans, horizon = Planner(config), [], None
    for k in range(count):
        others = obstacles((places + k * DT * 1e-6 * speeds) @ M.T, speeds @ M.T)
        now = epoch + k * DT
        if horizon is None:
            position, velocity, prediction = M @ x, M @ v, np.tile(M @ x, (16, 1))
        else:
            motion = horizon.at(now)
            position, velocity = motion.position, motion.velocity
            prediction = horizon.positions(now, 16, DT)
        plan = planner.plan(now, position, velocity, prediction, aim, others)
        horizon = plan.horizon
        plans.append(plan)
    return plans


def assert_alike(plans, others, matrix):
    for one, other in zip(plans, others, strict=True):
        for part in (slice(0, 3), slice(3, 6), slice(6, 9)):
            np.testing.assert_allclose(
                other.horizon.knots[:, part], one.horizon.knots[:, part] @ matrix.T, atol=1e-4
            )
        np.testing.assert_allclose(other.force, one.force @ matrix.T, atol=1e-4)
        np.testing.assert_allclose(other.gradient, one.gradient @ matrix.T, atol=1e-4)
        assert other.omega_scale == one.omega_scale


@QUICK
@given(seed=SEEDS)
def test_a_mirrored_scene_mirrors_the_plans(seed):
    assert_alike(encounter(seed, sense("own")), encounter(seed, sense("own"), MIRROR), MIRROR)


@QUICK
@given(seed=SEEDS)
def test_a_common_sense_is_mirrored_too(seed):
    assert_alike(encounter(seed, sense("right")), encounter(seed, sense("left"), MIRROR), MIRROR)


@QUICK
@given(seed=SEEDS, name=st.sampled_from(["own", "right"]))
def test_a_scene_turned_by_a_quarter_turns_the_plans(seed, name):
    """The box and the bounds are the same along x and y."""
    assert_alike(encounter(seed, sense(name)), encounter(seed, sense(name), QUARTER), QUARTER)


@QUICK
@given(seed=SEEDS, shift=st.integers(-(10**12), 10**12))
def test_only_differences_of_time_matter(seed, shift):
    for one, other in zip(encounter(seed, CONFIG), encounter(seed, CONFIG, epoch=START + shift), strict=True):
        np.testing.assert_array_equal(one.horizon.knots, other.horizon.knots)
        assert other.horizon.epoch - one.horizon.epoch == shift


@QUICK
@given(seed=SEEDS)
def test_the_same_scene_gives_the_same_plans_bit_for_bit(seed):
    for one, other in zip(encounter(seed, CONFIG), encounter(seed, CONFIG), strict=True):
        np.testing.assert_array_equal(one.horizon.knots, other.horizon.knots)
        np.testing.assert_array_equal(one.force, other.force)


def test_vehicles_do_not_share_what_their_planners_remember():
    """Two planners in turn plan as each would alone."""
    config = CONFIG
    starts, goals = ring(2, 4.0, 5.0), np.roll(ring(2, 4.0, 5.0, seed=2), 1, axis=0)
    interleaved = [s.plan for s in fly(config, starts, goals, 1.0)]
    swapped = list(fly(config, starts[::-1], goals[::-1], 1.0))
    swapped.sort(key=lambda s: (s.time, -s.vehicle))
    for one, other in zip(interleaved, swapped, strict=True):
        np.testing.assert_allclose(one.horizon.knots, other.plan.horizon.knots, atol=1e-9)


def test_a_plan_starts_at_the_state_and_respects_the_vehicle():
    for seed in range(20):
        for plan in encounter(seed, CONFIG, count=4):
            a = plan.horizon.knots[:-1, 6:9]
            assert (np.linalg.norm(a, axis=1) <= CONFIG.limits.a_total + 1e-9).all()
            assert (np.linalg.norm(plan.force, axis=1) <= CONFIG.limits.a_total + 1e-9).all()
            assert len(plan.horizon.knots) == CONFIG.horizon.steps + 2


def test_baseline_adds_nothing():
    for one, other in zip(
        encounter(3, configured(methods=("baseline",))), encounter(3, configured(methods=())), strict=True
    ):
        np.testing.assert_array_equal(one.horizon.knots, other.horizon.knots)
        assert one.omega_scale == 1.0


def test_planar_forces_are_level():
    plans = encounter(5, configured(planar=True))
    assert any(plan.force[:, :2].any() for plan in plans)
    assert not any(plan.force[:, 2].any() for plan in plans)


def test_at_its_destination_a_vehicle_rests():
    planner, here = Planner(CONFIG), np.array([3.0, -2.0, 5.0])
    plan = planner.plan(START, here, ZERO, np.tile(here, (16, 1)), standing(here, ZERO), obstacles([]))
    np.testing.assert_allclose(plan.horizon.knots[:, 0:3], np.tile(here, (17, 1)), atol=1e-6)
    np.testing.assert_allclose(plan.gradient, ZERO, atol=1e-6)


def separation(sightings, count):
    """Least distance (m) between any two vehicles at any plan."""
    places = np.array([s.position for s in sightings]).reshape(-1, count, 3)
    apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=3)
    return apart[:, ~np.eye(count, dtype=bool)].min()


def final_error(sightings, goals):
    count = len(goals)
    return max(np.linalg.norm(s.position - goals[s.vehicle]) for s in sightings[-count:])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_six_vehicles_swap_places_without_coming_too_near(seed):
    starts = ring(6, 6.0, 5.0, seed)
    goals = np.roll(starts, 3, axis=0)
    sightings = list(fly(sense("right"), starts, goals, 15.0))
    assert separation(sightings, 6) > CONFIG.field.d_min
    assert final_error(sightings, goals) < 0.3


WAYS_OUT = {
    "straight through": ([[0.0, 0.0, 5.0]], "own"),
    # Scenario III of the paper: four hover as a U.
    "into a U": ([[0.0, -3.0, 5.0], [2.2, -1.0, 5.0], [2.2, 1.0, 5.0], [0.0, 3.0, 5.0]], "right"),
}


@pytest.mark.parametrize("name", WAYS_OUT)
def test_the_band_leads_out_of_the_deadlock_in_which_the_field_alone_ends(name):
    """One vehicle, and hovering ones in its way: a local minimum of the field (Sec. III-D)."""
    standing, turning = WAYS_OUT[name]
    starts = np.array([[-6.0, 0.0, 5.0], *standing])
    goals = np.array([[7.0, 0.0, 5.0], *standing])
    errors = {}
    for method in ("baseline", "tangential"):
        config = configured(methods=(method,), turning_sense=turning)
        sightings = list(fly(config, starts, goals, 20.0, still=len(standing)))
        track = np.array([s.position for s in sightings])
        apart = np.linalg.norm(track[:, None] - np.array(standing), axis=2)
        assert apart.min() > CONFIG.field.d_min
        errors[method] = np.linalg.norm(track[-1] - goals[0])
    assert errors["baseline"] > 3.0
    assert errors["tangential"] < 0.3


@QUICK
@given(seed=SEEDS, later=st.integers(20_000, 2_000_000))
def test_the_field_goes_on_from_where_the_last_plan_saw_it(seed, later):
    """However seldom plans are made: a companion that is late evades with all its force."""
    jerk, planner = 3.5, Planner(configured(limits={"j_max": (3.5, 3.5, 3.5)}))
    x, away = np.array([0.0, 0.0, 6.0]), np.random.default_rng(seed).normal(size=3)
    still = np.tile(x, (16, 1))
    others = obstacles(np.array([x + 0.4 * away / np.linalg.norm(away)]), np.zeros((1, 3)))
    first = planner.plan(START, x, np.zeros(3), still, standing(x), others)
    second = planner.plan(START + later, x, np.zeros(3), still, standing(x), others)
    seen = first.force[min(later // DT, 15)]
    assert np.linalg.norm(second.force[0] - seen) <= jerk * 1e-6 * min(later, DT) + 1e-9
    assert np.linalg.norm(second.force[0]) >= np.linalg.norm(seen) - 1e-9


def test_on_a_way_no_method_turns_a_vehicle_aside_for_a_fixed_obstacle_but_the_field_repels_it():
    """A post and a neighbour on either side of the course, at the same distance."""
    post = {"kind": "post", "at": (3.5, 0.8), "radius": 0.5}
    beside = obstacles([[3.5, 0.8, 5.0], [3.5, -0.8, 5.0]])
    seen = beside._replace(ids=(FIRST_ID, 5), radius=np.array([0.5, 0.0]))
    here, alone = np.array([0.0, 0.0, 5.0]), seen.without(range(FIRST_ID, FIRST_ID + 1))
    assert alone.ids == (5,)
    aim = standing(np.array([9.0, 0.0, 5.0]))
    config = configured(obstacles=(post,), methods=("tangential",), turning_sense="right")
    without = configured(obstacles=(post,), methods=("baseline",))

    def forces(settings, others, *, clear):
        planner, prediction = (
            Planner(settings),
            np.tile(here, (16, 1)) + np.linspace(0, 2, 16)[:, None] * EAST,
        )
        for now in (START, START + DT):  # the second has a gradient, which the methods need
            plan = planner.plan(now, here, 2.0 * EAST, prediction, aim._replace(clear=clear), others)
        return plan.force

    field = forces(without, seen, clear=True)
    only_post = seen.without(range(5, 6))
    assert np.array_equal(forces(config, only_post, clear=True), forces(without, only_post, clear=True))
    assert not np.allclose(forces(config, only_post, clear=False), forces(without, only_post, clear=False))
    assert not np.allclose(forces(config, seen, clear=True), field)
    assert np.array_equal(forces(config, alone, clear=True), forces(config, alone, clear=False))
