"""Every QP of a flight: solved, optimal by its KKT conditions and by another solver, and within the vehicle's
limits."""

from __future__ import annotations

import daqp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls

from companion.avoidance.field.dqmpc import Dqmpc
from companion.config import CompanionConfig
from companion.config.planning import CostConfig, HorizonConfig, LimitsConfig
from companion.errors import ShapeError
from companion.values.vectors import limit
from tests.companion.rig import LAWS, QUICK, ZERO, fly, numbers, ring, vectors

TIGHT = CompanionConfig.model_validate(
    {"limits": {"v_max": (2.0, 2.0, 1.0), "box_min": (-6.0, -6.0, 4.5), "box_max": (6.0, 6.0, 5.5)}}
)
"""Limits so tight that six vehicles that swap places run into all of them."""

DEFAULT = Dqmpc(HorizonConfig(), CostConfig(), LimitsConfig())
LOPSIDED = LimitsConfig(
    u_max=(2.0, 1.0, 6.0), u_min=(-1.0, -2.0, -4.0), v_max=(4.0, 1.0, 2.0), v_min=(-1.5, -4.0, -1.0)
)
"""Least values that are not those of the other direction: v_z from −1 to 2 m/s, u_z from −4 to 6 m/s²."""
TURNED = LimitsConfig(
    u_max=(1.0, 2.0, 4.0),
    u_min=(-2.0, -1.0, -6.0),
    v_max=(1.5, 4.0, 1.0),
    v_min=(-4.0, -1.0, -2.0),
    box_min=(-20.0, -20.0, -10.0),
    box_max=(20.0, 20.0, -3.0),
)
"""The same in a mirror."""
A_TOTAL, U_MAX = 7.0, 2.0
SCALES = st.sampled_from([1.0, 0.1])


def fields(bound=A_TOTAL):
    """Fields f (16, 3) of norms up to the bound: held, as of a tangential force, or different at every n."""
    rows = st.lists(vectors(bound), min_size=16, max_size=16).map(np.array)
    held = vectors(bound).map(lambda row: np.repeat(row[None], 16, axis=0))
    pressed = vectors(1.0).map(
        lambda row: np.repeat(bound * (row / max(np.linalg.norm(row), 1e-3))[None], 16, axis=0)
    )
    return st.one_of(rows, held, pressed).map(lambda f: limit(f, bound))


@pytest.fixture(scope="module")
def flight():
    starts = ring(6, 5.6, 5.0, seed=1)
    return list(fly(TIGHT, starts, np.roll(ring(6, 5.6, 5.0, seed=3), 3, axis=0), 6.0))


def solution(made):
    """Accelerations (16, 3) of the QPs of a plan, before the walls amend them."""
    return made.planner.dqmpc.solve(made.plan.problem, made.plan.omega_scale).acceleration


def qps(sightings):
    """(AxisQp, solution (16,), whether its state limits had to go) of every axis of every plan."""
    for s in sightings:
        found = solution(s)
        for axis in range(3):
            qp = s.planner.dqmpc.axis(s.plan.problem, axis, s.plan.omega_scale)
            a = found[:, axis]
            given_up = s.plan.relaxed > 0 and len(qp.G) > 0 and oracle(qp) is None
            if given_up:
                qp = qp._replace(G=qp.G[:0], h_l=qp.h_l[:0], h_u=qp.h_u[:0])
            yield qp, a, given_up


def oracle(qp):
    """DAQP's minimiser (16,), or None where there is none."""
    upper, lower = np.concatenate([qp.x_u, qp.h_u]), np.concatenate([qp.x_l, qp.h_l])
    x, _, flag, _ = daqp.solve(
        np.ascontiguousarray(qp.P),
        qp.c.copy(),
        np.ascontiguousarray(qp.G).reshape(-1, len(qp.c)),
        upper,
        lower,
        np.zeros(len(upper), dtype=np.int32),
        primal_tol=1e-11,
    )
    return x if flag == 1 else None


def test_the_flight_is_a_hard_one(flight):
    """Forces act, bounds and state limits are active, both weights occur: else the laws below would be
    idle."""
    bounds = rows = 0
    for qp, a, _ in qps(flight):
        bounds += bool(((a - qp.x_l < 1e-6) | (qp.x_u - a < 1e-6)).any())
        ga = qp.G @ a
        rows += bool(((ga - qp.h_l < 1e-6) | (qp.h_u - ga < 1e-6)).any())
    assert bounds > 200
    assert rows > 100
    assert {s.plan.omega_scale for s in flight} == {1.0, 0.1}
    assert max(np.linalg.norm(s.plan.force, axis=1).max() for s in flight) > 5.0


def test_every_qp_of_a_flight_is_optimal_by_its_kkt_conditions(flight):
    for qp, a, _ in qps(flight):
        slacks = np.concatenate([a - qp.x_l, qp.x_u - a, qp.G @ a - qp.h_l, qp.h_u - qp.G @ a])
        assert slacks.min() > -1e-7
        # Multipliers λ ≥ 0 of what is active (complementarity) that balance the gradient (stationarity).
        eye = np.eye(len(a))
        normals = np.vstack([eye, -eye, qp.G, -qp.G])
        active = slacks < 1e-5
        gradient = qp.P @ a + qp.c
        residual = nnls(normals[active].T, gradient)[1] if active.any() else np.linalg.norm(gradient)
        assert residual < 1e-4 * (1.0 + np.abs(qp.c).max())


def test_every_qp_of_a_flight_has_daqps_solution(flight):
    for qp, a, _ in qps(flight):
        reference = oracle(qp)
        assert reference is not None
        np.testing.assert_allclose(a, reference, atol=1e-5)


def test_state_limits_are_given_up_only_where_they_contradict_each_other(flight):
    given_up = [gone for _, _, gone in qps(flight)]
    assert sum(given_up) == sum(s.plan.relaxed for s in flight)
    assert sum(given_up) < 0.03 * len(given_up)


def assert_within_u_max_of_the_field(dqmpc, problem, a, f):
    """On every axis but those where the field leaves no input that keeps the box."""
    opened = dqmpc.reachable(problem)
    presses = ((opened.x_l < problem.x_l) | (opened.x_u > problem.x_u)).any(axis=1)
    assert (np.abs(a - f) <= U_MAX + 1e-9)[:, ~presses].all()
    assert ((opened.x_l - 1e-9 <= a.T) & (opened.x_u + 1e-9 >= a.T)).all()


def test_a_flight_keeps_the_vehicles_acceleration(flight):
    for s in flight:
        a, dqmpc, problem = s.plan.horizon.knots[:-1, 6:9], s.planner.dqmpc, s.plan.problem
        assert (np.linalg.norm(a, axis=1) <= A_TOTAL + 1e-9).all()
        assert_within_u_max_of_the_field(dqmpc, problem, solution(s), s.plan.force)


@LAWS
@given(
    x=vectors(60.0),
    v=vectors(15.0),
    f=fields(),
    destination=vectors(60.0),
    velocity=vectors(10.0),
    scale=SCALES,
)
def test_any_state_and_field_is_solved_within_the_vehicles_limits(x, v, f, destination, velocity, scale):
    """Outside the box, too fast, pushed with all that the vehicle has: there is always a plan."""
    problem = DEFAULT.problem(x, v, f, destination, velocity, scale)
    a = DEFAULT.solve(problem, scale).acceleration
    assert np.isfinite(a).all()
    assert (np.linalg.norm(a, axis=1) <= A_TOTAL + 1e-9).all()
    assert_within_u_max_of_the_field(DEFAULT, problem, a, f)


CALM = {
    "x": st.tuples(numbers(-18, 18), numbers(-18, 18), numbers(3.5, 9.5)).map(np.array),
    "v": vectors(0.5),
    "destination": vectors(40.0),
    "scale": SCALES,
}
"""A calm state inside the limits, and wherever the vehicle is sent."""


@LAWS
@given(**CALM)
def test_without_a_field_a_calm_vehicle_keeps_its_box_and_speed(x, v, destination, scale):
    """Wherever it is sent: from a calm state inside the limits every later state can be inside."""
    solution = DEFAULT.solve(DEFAULT.problem(x, v, np.zeros((16, 3)), destination, ZERO, scale), scale)
    limits = LimitsConfig()
    velocities = v + DEFAULT.dt * np.cumsum(solution.acceleration, axis=0)
    before = np.vstack([v, velocities[:-1]])
    positions = x + np.cumsum(DEFAULT.dt * before + 0.5 * DEFAULT.dt**2 * solution.acceleration, axis=0)
    assert solution.relaxed == 0
    assert (np.abs(velocities) <= np.array(limits.v_max) + 1e-6).all()
    assert (positions >= np.array(limits.box_min) - 1e-6).all()
    assert (positions <= np.array(limits.box_max) + 1e-6).all()


@LAWS
@given(**CALM)
def test_a_calm_vehicle_keeps_least_and_largest_values(x, v, destination, scale):
    """No acceleration and no velocity of its plan is beyond a bound, in either direction."""
    dqmpc = Dqmpc(HorizonConfig(), CostConfig(), LOPSIDED)
    solution = dqmpc.solve(dqmpc.problem(x, v, np.zeros((16, 3)), destination, ZERO, scale), scale)
    a = solution.acceleration
    velocities = v + dqmpc.dt * np.cumsum(a, axis=0)
    assert solution.relaxed == 0
    assert (a >= np.array(LOPSIDED.least_u) - 1e-9).all()
    assert (a <= np.array(LOPSIDED.u_max) + 1e-9).all()
    assert (velocities >= np.array(LOPSIDED.least_v) - 1e-6).all()
    assert (velocities <= np.array(LOPSIDED.v_max) + 1e-6).all()


@LAWS
@given(x=vectors(60.0), v=vectors(15.0), f=fields(), destination=vectors(60.0), scale=SCALES)
def test_any_state_is_solved_within_least_and_largest_values(x, v, f, destination, scale):
    """Inputs stay within their bounds but on axes where the field leaves none that keeps the box."""
    dqmpc = Dqmpc(HorizonConfig(), CostConfig(), LOPSIDED)
    problem = dqmpc.problem(x, v, f, destination, ZERO, scale)
    a = dqmpc.solve(problem, scale).acceleration
    opened = dqmpc.reachable(problem)
    presses = ((opened.x_l < problem.x_l) | (opened.x_u > problem.x_u)).any(axis=1)
    assert (np.linalg.norm(a, axis=1) <= A_TOTAL + 1e-9).all()
    # Where |f| is near a_total the ball of the vehicle cuts inputs off, down to those that only weaken f.
    assert (a <= np.maximum(f + LOPSIDED.u_max, 0.0) + 1e-9)[:, ~presses].all()
    assert (a >= np.minimum(f + LOPSIDED.least_u, 0.0) - 1e-9)[:, ~presses].all()
    assert ((opened.x_l - 1e-9 <= a.T) & (opened.x_u + 1e-9 >= a.T)).all()
    assert ((problem.far_l - 1e-9 <= a.T) & (problem.far_u + 1e-9 >= a.T)).all()


@LAWS
@given(x=vectors(60.0), v=vectors(15.0), f=fields(), destination=vectors(60.0), scale=SCALES)
def test_least_and_largest_values_change_places_in_a_mirror(x, v, f, destination, scale):
    """Also where bounds are opened and limits widened: each side has its own bounds."""
    one, two = (Dqmpc(HorizonConfig(), CostConfig(), limits) for limits in (LOPSIDED, TURNED))
    found = one.reachable(one.problem(x, v, f, destination, ZERO, scale))
    turned = two.reachable(two.problem(-x, -v, -f, -destination, ZERO, scale))
    for low, high in (("x_l", "x_u"), ("h_l", "h_u"), ("far_l", "far_u")):
        np.testing.assert_allclose(getattr(turned, low), -getattr(found, high), atol=1e-9)
        np.testing.assert_allclose(getattr(turned, high), -getattr(found, low), atol=1e-9)


@LAWS
@given(f=fields(0.7), offset=vectors(0.5), v=vectors(0.2), scale=SCALES)
def test_a_small_field_is_cancelled_exactly(f, offset, v, scale):
    """The cost sees a = u + f alone, so that f acts only where it makes u saturate."""
    x = np.array([0.0, 0.0, 6.0])
    with_field = DEFAULT.solve(DEFAULT.problem(x, v, f, x + offset, ZERO, scale), scale)
    without = DEFAULT.solve(DEFAULT.problem(x, v, np.zeros((16, 3)), x + offset, ZERO, scale), scale)
    # Not saturated in either: |a| stays below u_max − |f|.
    assert np.abs(without.acceleration).max() < U_MAX - 0.7
    np.testing.assert_allclose(with_field.acceleration, without.acceleration, atol=1e-5)


@LAWS
@given(direction=vectors(1.0).filter(lambda d: float(d @ d) > 0.01), scale=SCALES)
def test_a_field_beyond_u_max_moves_the_vehicle_its_way(direction, scale):
    f = np.repeat(6.0 * direction[None] / np.linalg.norm(direction), 16, axis=0)
    x = np.array([0.0, 0.0, 6.0])
    a = DEFAULT.solve(DEFAULT.problem(x, ZERO, f, x, ZERO, scale), scale).acceleration
    pressed = np.abs(f[0]) > U_MAX + 0.1
    assert (np.sign(a[0]) == np.sign(f[0]))[pressed].all()


@QUICK
@given(x=vectors(10.0), v=vectors(3.0), f=fields(), other=vectors(30.0))
def test_what_was_solved_before_leaves_no_trace(x, v, f, other):
    """No warm start: one set of solvers serves many vehicles, bit for bit."""
    problem = DEFAULT.problem(x, v, f, ZERO, ZERO, 1.0)
    first = DEFAULT.solve(problem, 1.0)
    DEFAULT.solve(DEFAULT.problem(other, v, -f, other, v, 1.0), 1.0)
    again = DEFAULT.solve(problem, 1.0)
    fresh = Dqmpc(HorizonConfig(), CostConfig(), LimitsConfig()).solve(problem, 1.0)
    np.testing.assert_array_equal(first.acceleration, again.acceleration)
    np.testing.assert_array_equal(first.acceleration, fresh.acceleration)


@LAWS
@given(a=fields(), end=vectors(10.0), v_end=vectors(5.0), destination=vectors(10.0), velocity=vectors(3.0))
def test_the_gradient_is_that_of_the_cost_by_finite_differences(a, end, v_end, destination, velocity):
    cost, dt, step = CostConfig(), 0.1, 1e-4

    def terminal(x, v):
        return cost.omega_t_position * np.sum((x - destination) ** 2) + cost.omega_t_velocity * np.sum(
            (v - velocity) ** 2
        )

    expected = np.empty(3)
    for axis, e in enumerate(np.eye(3)):

        def by_input(h, e=e):
            x, v = end + 0.5 * dt**2 * h * e, v_end + dt * h * e
            return cost.omega_i * np.sum((a[-1] + h * e) ** 2) + terminal(x, v)

        by_state = terminal(end + step * e, v_end) - terminal(end - step * e, v_end)
        total = by_state + by_input(step) - by_input(-step)
        expected[axis] = total / (2 * step) / cost.omega_t_position
    gradient = DEFAULT.gradient(a, end, v_end, destination, velocity)
    np.testing.assert_allclose(gradient, expected, atol=1e-5)
    np.testing.assert_array_equal(
        DEFAULT.gradient(0.0 * a, destination, velocity, destination, velocity), ZERO
    )


@pytest.mark.parametrize("name", ["c", "x_l", "x_u", "h_l", "h_u"])
@pytest.mark.parametrize("row", [0, 2])
def test_a_nan_anywhere_in_the_problem_is_refused(name, row):
    x = np.array([18.0, 18.0, 9.0])
    problem = DEFAULT.problem(x, np.full(3, 3.0), np.zeros((16, 3)), ZERO, ZERO, 1.0)
    poisoned = getattr(problem, name).copy()
    poisoned[row, 3] = np.nan
    with pytest.raises(ShapeError):
        DEFAULT.solve(problem._replace(**{name: poisoned}), 1.0)


@pytest.mark.parametrize("argument", ["x", "v", "destination", "velocity"])
def test_a_nan_in_what_is_planned_from_never_becomes_a_plan(argument):
    arguments = {"x": np.array([0.0, 0.0, 5.0]), "v": ZERO, "destination": ZERO, "velocity": ZERO}
    arguments[argument] = np.array([0.0, np.nan, 5.0])
    with pytest.raises(ShapeError):
        DEFAULT.solve(DEFAULT.problem(f=np.zeros((16, 3)), omega_scale=1.0, **arguments), 1.0)
