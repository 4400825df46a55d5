"""Laws of PX4's position controller: speed of corrections, and what it does not learn."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.autopilot.position_control.airframe import GRAVITY
from sitl.autopilot.position_control.px4 import _excess, _within
from tests.sitl.response_rig import led, made, step


def test_a_step_is_chased_at_no_more_than_the_speed_limit() -> None:
    flown, _ = led(made("px4", px4={"speed": 2.0}), step(20.0), 40.0)
    assert flown[:, 1, 0].max() < 2.0 * 1.25
    assert flown[2000:, 0, 0].min() > 19.0
    assert abs(flown[-1, 0, 0] - 20.0) < 0.05


@given(
    st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0)),
    st.tuples(st.floats(-15.0, 15.0), st.floats(-15.0, 15.0)),
    st.floats(0.5, 12.0),
)
@settings(max_examples=50)
def test_corrections_come_before_the_set_points_own_velocity(
    gap: tuple[float, float], velocity: tuple[float, float], most: float
) -> None:
    found = _within(gap, velocity, most)
    assert math.hypot(*found) <= most * (1.0 + 1e-9) + 1e-12
    total = gap[0] + velocity[0], gap[1] + velocity[1]
    if math.hypot(*total) <= most:
        assert found == total
    elif math.hypot(*gap) < most:
        # All of the correction, and a part of the velocity.
        part = found[0] - gap[0], found[1] - gap[1]
        assert abs(part[0] * velocity[1] - part[1] * velocity[0]) < 1e-6
        assert part[0] * velocity[0] + part[1] * velocity[1] >= -1e-9
        assert math.hypot(*part) <= math.hypot(*velocity) + 1e-9
    else:
        assert abs(found[0] * gap[1] - found[1] * gap[0]) < 1e-6


def test_what_tilt_cannot_give_is_not_learnt() -> None:
    """Else a PX4 would fly past its goal by half of a long way."""
    flown, _ = led(made("px4", px4={"tilt": math.radians(15.0)}), step(40.0), 40.0)
    assert flown[:, 0, 0].max() < 40.5
    assert flown[-1, 0, 0] > 39.5


@given(
    wanted=st.tuples(*[st.floats(-8.0, 8.0)] * 2),
    share=st.floats(0.0, 1.0),
    down=st.floats(-GRAVITY, 2.0 * GRAVITY),
)
def test_px4_does_not_learn_what_a_smaller_thrust_cannot_give(
    wanted: tuple[float, float], share: float, down: float
) -> None:
    """Its thrust tilts for the wanted acceleration as in a hover, and is less while it accelerates down."""
    tilted = share * wanted[0], share * wanted[1]
    lift = max(GRAVITY - down, 0.0) / GRAVITY
    missing = max(1.0 - lift * share, 0.0)
    assert _excess(wanted, tilted, down) == pytest.approx((missing * wanted[0], missing * wanted[1]))
