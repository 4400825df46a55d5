"""Double integrators keep their limits, and fly as one that is alone must; no peer has to be installed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.integrators import A_MAX, STEP, V_MAX, Array, FreeMotion, fly, nearest, preferred

MANNERS = st.builds(FreeMotion, st.floats(1.0, 1.8), st.floats(1.5, 3.0), st.floats(0.0, 0.4))


class Wilful:
    """Everyone flies as if it were alone; what is seen is kept."""

    def __init__(self) -> None:
        self.seen: list[Array] = []

    def velocities(self, positions: Array, velocities: Array, preferred: Array) -> Array:
        self.seen.append(velocities)
        return preferred


@pytest.mark.slow
@given(MANNERS, st.floats(1.0, 40.0))
def test_it_keeps_its_limits_and_takes_no_less_than_it_must(manner: FreeMotion, length: float) -> None:
    wilful = Wilful()
    way = length * np.array([[0.6, 0.8]])
    flown = fly(np.zeros((1, 2)), way, wilful, manner, 0.5, 60.0)
    speeds = np.array(wilful.seen)[:, 0]
    assert np.linalg.norm(speeds, axis=1).max() <= V_MAX + 1e-9
    assert np.linalg.norm(np.diff(speeds, axis=0), axis=1).max() <= A_MAX * STEP + 1e-9
    # At full power until it has to brake; it has arrived 0.3 m before, at no more than 0.3 m/s.
    peak = min(V_MAX, math.sqrt(A_MAX * length))
    shortest = 2.0 * peak / A_MAX + (length - peak**2 / A_MAX) / V_MAX
    assert flown.converged_s is not None
    assert flown.converged_s >= shortest - 0.3 / A_MAX - 0.3 / V_MAX - STEP
    assert flown.separation_m == math.inf


def test_who_does_not_give_way_collides() -> None:
    ends = np.array([[-4.0, 0.0], [4.0, 0.0]])
    straight = fly(ends, -ends, Wilful(), FreeMotion(1.6, 2.0, 0.0), 0.5, 60.0)
    assert straight.separation_m == pytest.approx(0.0, abs=1e-6)
    assert straight.below_s > 0.0
    aside = fly(ends, -ends, Wilful(), FreeMotion(1.6, 2.0, 0.3), 0.5, 60.0)
    assert aside.separation_m > 0.5
    assert aside.below_s == 0.0


def test_who_has_no_time_does_not_converge() -> None:
    assert (
        fly(np.zeros((1, 2)), np.ones((1, 2)), Wilful(), FreeMotion(1.6, 2.0, 0.0), 0.5, 1.0).converged_s
        is None
    )


@given(MANNERS, st.floats(0.01, 30.0))
def test_braking_is_as_it_is_said(manner: FreeMotion, distance: float) -> None:
    """v dv/dd is the deceleration."""
    near, far = (
        float(np.linalg.norm(preferred(np.array([[d, 0.0]]), manner))) for d in (distance, distance + 1e-4)
    )
    assert (far**2 - near**2) / 2e-4 <= manner.braking * (1.0 + 1e-3) + 1e-3


def test_right_is_right() -> None:
    ((east, north),) = preferred(np.array([[0.0, 10.0]]), FreeMotion(1.6, 2.0, 0.1))
    assert east > 0.0
    assert math.atan2(east, north) == pytest.approx(0.1)


@given(st.lists(st.floats(-5.0, 5.0), min_size=4, max_size=4))
def test_the_nearest_of_a_step_is_found_between_its_ends(numbers: list[float]) -> None:
    before, after = np.array([numbers[:2]]), np.array([numbers[2:]])
    shares = np.linspace(0.0, 1.0, 1001)[:, None]
    sampled = np.linalg.norm((1.0 - shares) * before + shares * after, axis=1).min()
    found = nearest(before, after)
    assert sampled - 0.02 <= found <= sampled + 1e-9
