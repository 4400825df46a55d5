"""Velocity at a waypoint that is flown through."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.autopilot.missions.corners import passing
from sitl.values.setpoints import ZERO
from tests.sitl.autopilot_rig import Rig

CONFIG = Rig("px4").config
place = st.tuples(*[st.floats(-200.0, 200.0)] * 3)


def test_a_straight_way_keeps_its_speed_and_a_corner_stops() -> None:
    assert passing(ZERO, (20.0, 0.0, 0.0), (40.0, 0.0, 0.0), 4.0, CONFIG) == pytest.approx((4.0, 0.0, 0.0))
    assert passing(ZERO, (20.0, 0.0, 0.0), (20.0, 20.0, 0.0), 4.0, CONFIG) == ZERO
    assert passing(ZERO, (20.0, 0.0, 0.0), ZERO, 4.0, CONFIG) == ZERO
    assert passing(ZERO, (20.0, 0.0, 0.0), None, 4.0, CONFIG) == ZERO


@given(begin=place, corner=place, end=place, speed=st.floats(0.1, 20.0))
def test_the_velocity_is_along_the_leg_within_its_speed_and_can_be_braked(begin, corner, end, speed) -> None:
    velocity = passing(begin, corner, end, speed, CONFIG)
    fast = math.hypot(*velocity)
    leg = [b - a for a, b in zip(begin, corner, strict=True)]
    assert fast <= speed * (1 + 1e-9)
    assert sum(v * d for v, d in zip(velocity, leg, strict=True)) == pytest.approx(fast * math.hypot(*leg))
    assert fast**2 <= 2 * CONFIG.gentle_acceleration * math.dist(corner, end) + 1e-9
