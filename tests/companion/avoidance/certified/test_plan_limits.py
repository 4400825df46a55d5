"""A plan that was changed after its rounding passes no limit further than any rounded plan may."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.avoidance.certified import commitment as module
from companion.avoidance.certified.commitment import Commitment, HoldReason
from companion.avoidance.certified.committed import accelerations_of, committed, controls, with_accelerations
from companion.avoidance.certified.deadlock import DeadlockTurn
from companion.avoidance.certified.plan_limits import PlanLimits
from companion.avoidance.certified.qp import Objective, SeparationQp
from companion.avoidance.certified.separating_planes import Others, Planes
from companion.config.planning import LimitsConfig
from companion.values.horizon import Array
from companion.ways.subgoal import Subgoal
from mavlink_bridge.wire.plan import WirePlan, quantise
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS, random_plan
from tests.companion.avoidance.certified.scenes import CONFIG

HERE = np.array([0.0, 0.0, 5.0])
NOBODY = Others(*np.zeros((2, 0, STEPS, 3, 3)), np.zeros((0, STEPS)))
seeds = st.integers(0, 2**32 - 1)


def at_rest(place: Array = HERE) -> WirePlan:
    return quantise(EPOCH, DT, place, np.zeros(3), np.zeros((STEPS, 3)), 7)


def flight(place: Array = HERE, **steps: tuple[int, ...]) -> WirePlan:
    """A plan from rest with accelerations (mm/s²) of some axes, then its end at rest."""
    units = np.zeros((STEPS, 3), np.int64)
    for name, values in steps.items():
        units[: len(values), "xyz".index(name)] = values
    assert not units.sum(axis=0).any()
    return with_accelerations(at_rest(place), units)


def passes(plan: WirePlan, limits: LimitsConfig, old: WirePlan, before: Array | None = None) -> bool:
    """Whether the plan passes a limit further than it may."""
    check = PlanLimits(STEPS, DT, limits)
    return not check.kept(old, controls(old), plan, controls(plan), np.zeros(3) if before is None else before)


@pytest.mark.parametrize(
    ("limits", "within", "outside"),
    [
        # Accelerations: to the unit.
        ({}, {"x": (2000, -2000)}, {"x": (2001, -2001)}),
        ({"u_min": -1.0}, {"z": (500, 500, -1000)}, {"z": (500, 501, -1001)}),
        # Changes of 4 m/s³ · 0.2 s; rounding of two accelerations is a unit.
        ({"j_max": 4.0}, {"x": (800, 1, -800, -1)}, {"x": (802, 0, -802)}),
        ({"j_max": 4.0}, {"x": (400, -401, 1)}, {"x": (400, -402, 2)}),
        # Speeds: 1 m/s after two steps, and rounding of 0.2 mm/s.
        ({"v_max": 0.2}, {"y": (500, 501, -1001)}, {"y": (500, 502, -1002)}),
        ({"v_min": -0.2}, {"z": (-500, -501, 1001)}, {"z": (-500, -502, 1002)}),
    ],
)
def test_the_bounds_of_single_values(
    limits: dict[str, float], within: dict[str, tuple[int, ...]], outside: dict[str, tuple[int, ...]]
) -> None:
    of = LimitsConfig.model_validate({"u_max": 2.0, **limits})
    assert not passes(flight(**within), of, at_rest())
    assert passes(flight(**outside), of, at_rest())
    # What the committed plan has already is allowed.
    assert not passes(flight(**outside), of, flight(**outside))


def test_a_place_is_no_further_outside_the_box_than_rounding_moves_it() -> None:
    limits = LimitsConfig(box_min=(-20.0, -20.0, 5.0))
    # Both end lower than the floor, by 0.12 and 2.8 mm; the most by rounding is 2.56 mm at the plan's end.
    assert not passes(flight(z=(0,) * 12 + (-1, 0, 0, 1)), limits, at_rest())
    assert passes(flight(z=(-5, *(0,) * 13, 5)), limits, at_rest())


@given(seeds)
def test_any_rounded_plan_that_kept_its_limits_keeps_them(seed: int) -> None:
    """With limits that the plan just reaches before its rounding; accelerations have 10 mm/s² more."""
    rng = np.random.default_rng(seed)
    start = at_rest()
    a = rng.uniform(-0.7, 0.7, (STEPS, 3))
    a -= a.mean(axis=0)
    dt = 1e-6 * DT
    v = np.vstack([np.zeros((1, 3)), dt * np.cumsum(a, axis=0)])
    x = HERE + np.vstack([np.zeros((1, 3)), np.cumsum(0.5 * dt * (v[:-1] + v[1:]), axis=0)])
    between = x[:-1] + 0.5 * dt * v[:-1]
    places = np.vstack([x, between])
    changes = np.abs(np.diff(a, axis=0, prepend=0.0, append=0.0))
    limits = LimitsConfig(
        u_max=tuple(a.max(axis=0) + 0.01),
        u_min=tuple(a.min(axis=0) - 0.01),
        v_max=tuple(np.maximum(v.max(axis=0), 1e-3)),
        v_min=tuple(np.minimum(v.min(axis=0), -0.1)),
        j_max=tuple(changes.max(axis=0) / dt),
        box_min=tuple(places.min(axis=0) - 1e-9),
        box_max=tuple(places.max(axis=0) + 1e-9),
    )
    assert not passes(committed(start, a), limits, start)


@given(seeds)
def test_no_acceleration_passes_its_limit_or_what_the_committed_plan_has_by_a_unit(seed: int) -> None:
    """Of a plan beside the committed one, some accelerations of which are near the limits."""
    rng = np.random.default_rng(seed)
    old = random_plan(rng, HERE)
    units = accelerations_of(old) + rng.integers(-8, 9, (STEPS, 3))
    units[-1] -= units.sum(axis=0) - accelerations_of(old).sum(axis=0)
    plan = with_accelerations(old, units)
    most = 1e-3 * float(np.abs(accelerations_of(old)).max())
    limits = LimitsConfig(u_max=max(most - 0.004, 0.1))
    found, was = 1e-3 * units, 1e-3 * accelerations_of(old)
    beyond = np.abs(found) > np.maximum(np.abs(was), limits.u_max[0]) + 1e-9
    assume(beyond.any())
    assert passes(plan, limits, old)


def _given(better: WirePlan, plan: WirePlan, planes: Planes) -> WirePlan:
    return better


def _are(wanted: Array, planes: Planes, points: Array) -> bool:
    return bool((points == wanted).all())


def test_a_mended_plan_beyond_a_limit_is_not_flown(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rounded plan breaks a plane, and its mending keeps all planes: so its limits decide."""
    results = []
    for more in (0, 1):
        limits = LimitsConfig()
        kept = Commitment(CONFIG, SeparationQp(STEPS, limits, CONFIG), DeadlockTurn(CONFIG.deadlock), 7)
        kept.begin(EPOCH, HERE)
        start = kept.start()
        units = np.zeros((STEPS, 3), np.int64)
        units[:2, 0] = 2000 + more, -2000 - more
        better = with_accelerations(start, units)
        goal = HERE + np.array([1.0, 0.0, 0.0])
        monkeypatch.setattr(module, "mended", partial(_given, better))
        monkeypatch.setattr(module, "kept", partial(_are, controls(better)))
        towards = Objective(np.broadcast_to(goal, (STEPS, 3)), *np.zeros((2, STEPS, 3)))
        results.append(kept.replan(towards, Subgoal(goal, 0.0), NOBODY))
        assert kept.following == (start if more else better)
        assert kept.held[HoldReason.ROUNDING] == more
    assert results == [True, False]
