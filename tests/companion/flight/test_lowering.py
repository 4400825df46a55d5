"""Configured limits are lowered to what the autopilot can follow, and never raised."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from companion.config.planning import LimitsConfig
from companion.flight.autopilots import Shaping
from companion.flight.autopilots.limits import limits_of, stock_parameters
from companion.flight.lowering import lowered
from outrider.resources import find
from outrider.scenarios.fly_config import FlyConfig
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.yaml_file import load
from tests.companion.bench import PROFILES

ARDUPILOT, PX4 = PROFILES["ardupilot"], PROFILES["px4"]
SHIPPED = load(find("companions", "ardupilot"), FlyConfig).companion.limits
UNBOUNDED = SHIPPED.model_copy(update={"j_max": None})


@st.composite
def vehicles(draw):
    """A profile, and some of its parameters, from a twentieth of stock to twice as much."""
    profile = draw(st.sampled_from([ARDUPILOT, PX4]))
    stock = stock_parameters(profile.autopilot)
    shares = draw(st.dictionaries(st.sampled_from(sorted(stock)), st.floats(0.05, 2.0)))
    return profile, {name: share * stock[name] for name, share in shares.items()}


@st.composite
def limits(draw):
    u = draw(st.tuples(*[st.floats(0.2, 5.0)] * 3))
    v = draw(st.tuples(*[st.floats(0.2, 15.0)] * 3))
    least_u = draw(st.none() | st.tuples(*[st.floats(-5.0, -0.2)] * 3))
    least_v = draw(st.none() | st.tuples(*[st.floats(-15.0, -0.2)] * 3))
    a_total = draw(st.floats(max(*u, *(-low for low in least_u or ())), 20.0))
    j = draw(st.none() | st.tuples(*[st.floats(0.5, 30.0)] * 3))
    return LimitsConfig(u_max=u, u_min=least_u, v_max=v, v_min=least_v, a_total=a_total, j_max=j)


@pytest.mark.parametrize("flavour", PROFILES)
@pytest.mark.parametrize("received", [True, False], ids=["read", "assumed"])
def test_stock_firmware_follows_the_shipped_files(flavour, received):
    profile = PROFILES[flavour]
    config = load(find("companions", flavour), FlyConfig).companion
    values = stock_parameters(profile.autopilot) if received else {}
    found = lowered(config.limits, profile, values)
    assert config.limits_from_autopilot
    assert (found.changes, found.lacking) == ((), "")
    assert found.limits is config.limits
    assert found.loop == profile.loop
    sortie = load(find("scenarios", "sortie"), Scenario).companion
    assert (sortie.limits_from_autopilot, sortie.limits) == (True, config.limits)


@given(vehicle=vehicles(), asked=limits())
@example(
    vehicle=(ARDUPILOT, {}),
    asked=LimitsConfig(u_max=(1.0,) * 3, v_max=(1.0,) * 3, a_total=1.0, j_max=(1.0, 4.0, 1.0)),
)
def test_plans_stay_within_configuration_and_autopilot(vehicle, asked):
    profile, parameters = vehicle
    able = limits_of(profile.autopilot, parameters)
    found = lowered(asked, profile, parameters)
    if found.lacking:
        assert found.limits is asked
        return
    kept, near = found.limits, 1.001
    LimitsConfig.model_validate(kept.model_dump())
    for before, after in ((asked.u_max, kept.u_max), (asked.v_max, kept.v_max)):
        assert all(now <= was for was, now in zip(before, after, strict=True))
    for before, after in ((asked.least_u, kept.least_u), (asked.least_v, kept.least_v)):
        assert all(now >= was for was, now in zip(before, after, strict=True))
    assert kept.a_total <= asked.a_total
    assert kept.a_total <= found.acceleration * near
    assert found.acceleration == pytest.approx(0.9 * 9.80665 * math.tan(able.tilt))
    assert max(kept.strongest[:2]) <= able.acceleration * near
    assert math.hypot(*kept.fastest[:2]) <= able.speed * near
    assert kept.v_max[2] <= able.climb * near
    assert -kept.least_v[2] <= able.sink * near
    if able.shaped:
        assert max(kept.j_max[:2]) <= 0.7 * able.jerk * near
    else:
        assert kept.j_max == asked.j_max
    assert (kept.box_min, kept.box_max) == (asked.box_min, asked.box_max)
    assert bool(found.changes) == (kept != asked)
    # Nothing is left to lower.
    assert lowered(kept, profile, parameters).changes == ()


def test_a_least_velocity_stays_valid_however_low_the_speed_is():
    """Found by the law above: −0.25 m/s is lowered in proportion to v_max of 7 m/s."""
    asked = LimitsConfig(v_max=(1.0, 7.0, 1.0), v_min=(-1.0, -0.25, -1.0))
    kept = lowered(asked, ARDUPILOT, {"WPNAV_SPEED": 250.0}).limits
    assert kept.v_min[1] == -0.1
    LimitsConfig.model_validate(kept.model_dump())


@pytest.mark.parametrize(
    ("profile", "parameters", "changes"),
    [
        (ARDUPILOT, {"PSC_JERK_XY": 1.0}, ("j_max 0.7 m/s³ (PSC_JERK_XY 1)",)),
        (ARDUPILOT, {"ATC_ACCEL_P_MAX": 5000.0}, ("j_max 1.62 m/s³ (ATC_ACCEL_P_MAX 5000)",)),
        (ARDUPILOT, {"WPNAV_ACCEL": 150.0}, ("u_max 1.5 m/s² (WPNAV_ACCEL 150)",)),
        (ARDUPILOT, {"WPNAV_SPEED": 300.0}, ("v_max 2.12 m/s (WPNAV_SPEED 300)",)),
        (ARDUPILOT, {"WPNAV_SPEED_DN": 80.0}, ("v_max up 0.8 m/s (WPNAV_SPEED_DN 80)",)),
        (ARDUPILOT, {"WPNAV_SPEED_UP": 70.0}, ("v_max up 0.7 m/s (WPNAV_SPEED_UP 70)",)),
        (ARDUPILOT, {"ANGLE_MAX": 2000.0}, ("a_total 3.21 m/s² (ANGLE_MAX 2000)",)),
        (ARDUPILOT, {"ANGLE_MAX": 3000.0, "PSC_ANGLE_MAX": 20.0}, ("a_total 3.21 m/s² (PSC_ANGLE_MAX 20)",)),
        (
            ARDUPILOT,
            {"ANGLE_MAX": 1000.0},
            (
                "a_total 1.56 m/s² (ANGLE_MAX 1000)",
                "u_max 1.56 m/s² (ANGLE_MAX 1000)",
                "u_max up 1.56 m/s² (ANGLE_MAX 1000)",
            ),
        ),
        (PX4, {"MPC_JERK_MAX": 2.0}, ()),
        (PX4, {"MPC_XY_VEL_MAX": 4.0}, ("v_max 2.83 m/s (MPC_XY_VEL_MAX 4)",)),
        (PX4, {"MPC_Z_VEL_MAX_DN": 1.0}, ("v_max up 1 m/s (MPC_Z_VEL_MAX_DN 1)",)),
        (PX4, {"MPC_TILTMAX_AIR": 20.0}, ("a_total 3.21 m/s² (MPC_TILTMAX_AIR 20)",)),
    ],
)
def test_what_is_lowered_is_named_with_its_parameter(profile, parameters, changes):
    assert lowered(SHIPPED, profile, parameters).changes == changes


def test_climb_and_descent_are_lowered_apart_where_both_are_stated():
    asked = SHIPPED.model_copy(update={"v_min": (-2.0, -2.0, -1.0), "u_min": (-2.0, -2.0, -4.0)})
    parameters = {"WPNAV_SPEED_DN": 80.0, "WPNAV_SPEED_UP": 150.0, "ANGLE_MAX": 2000.0}
    found = lowered(asked, ARDUPILOT, parameters)
    assert (found.limits.v_max[2], found.limits.v_min[2]) == (min(SHIPPED.v_max[2], 1.5), -0.8)
    assert found.limits.u_min[2] == -found.limits.a_total
    assert "v_min vertical -0.8 m/s (WPNAV_SPEED_DN 80)" in found.changes
    assert "u_min vertical -3.21 m/s² (ANGLE_MAX 2000)" in found.changes


def test_jerk_that_is_not_bounded_is_bounded_where_the_firmware_does():
    found = lowered(UNBOUNDED, ARDUPILOT, {})
    assert found.limits.j_max == (3.5, 3.5, 3.5)
    assert found.changes == ("j_max 3.5 m/s³ (PSC_JERK_XY 5)",)
    assert lowered(UNBOUNDED, PX4, {}).limits is UNBOUNDED


@pytest.mark.parametrize(
    ("profile", "name", "value", "lacking"),
    [
        (ARDUPILOT, "PSC_JERK_XY", 0.5, "a jerk of 1 m/s³ at least: PSC_JERK_XY 0.5 gives 0.5"),
        (
            ARDUPILOT,
            "WPNAV_ACCEL",
            50.0,
            "a horizontal acceleration of 1 m/s² at least: WPNAV_ACCEL 50 gives 0.5",
        ),
        (ARDUPILOT, "ANGLE_MAX", 900.0, "a tilt of 10 ° at least: ANGLE_MAX 900 gives 9"),
        (ARDUPILOT, "WPNAV_SPEED", 20.0, "a speed of 1 m/s at least: WPNAV_SPEED 20 gives 0.2"),
        (
            ARDUPILOT,
            "WPNAV_SPEED_DN",
            10.0,
            "a rate of descent of 0.3 m/s at least: WPNAV_SPEED_DN 10 gives 0.1",
        ),
        (ARDUPILOT, "PSC_POSXY_P", 0.1, "a position gain of 0.3 1/s at least: PSC_POSXY_P 0.1 gives 0.1"),
        (PX4, "MPC_ACC_HOR", 0.5, "a horizontal acceleration of 1 m/s² at least: MPC_ACC_HOR 0.5 gives 0.5"),
        (PX4, "MPC_Z_VEL_MAX_UP", 0.2, "a rate of climb of 0.3 m/s at least: MPC_Z_VEL_MAX_UP 0.2 gives 0.2"),
        (PX4, "MPC_XY_VEL_P_ACC", 0.2, "a velocity gain of 0.5 1/s at least: MPC_XY_VEL_P_ACC 0.2 gives 0.2"),
    ],
)
def test_what_no_escort_can_do_without_is_named(profile, name, value, lacking):
    assert lowered(SHIPPED, profile, {name: value}).lacking == lacking


@pytest.mark.parametrize("flavour", PROFILES)
def test_the_least_that_an_escort_needs_is_enough(flavour):
    least = {
        "ardupilot": {"PSC_JERK_XY": 1.0, "WPNAV_ACCEL": 100.0, "WPNAV_SPEED": 100.0, "ANGLE_MAX": 1000.0},
        "px4": {"MPC_ACC_HOR": 1.0, "MPC_XY_VEL_MAX": 1.0, "MPC_JERK_MAX": 0.5, "MPC_TILTMAX_AIR": 10.0},
    }[flavour]
    profile = PROFILES[flavour]
    found = lowered(SHIPPED, profile, least)
    assert found.lacking == ""
    assert found.limits.u_max[0] == pytest.approx(1.0)
    assert math.hypot(*found.limits.v_max[:2]) == pytest.approx(1.0)


def test_the_gains_are_the_vehicles():
    told = {"PSC_POSXY_P": 0.6, "PSC_VELXY_P": 1.5, "PSC_JERK_XY": 2.5, "WPNAV_ACCEL": 200.0}
    found = lowered(SHIPPED, ARDUPILOT, told)
    assert found.loop == ARDUPILOT.loop._replace(
        position=0.6, velocity=1.5, slew=0.5 * ARDUPILOT.loop.slew, shaping=Shaping(2.5, 0.625, 1.25)
    )
    raised = lowered(SHIPPED, ARDUPILOT, {"PSC_JERK_XY": 7.5})
    assert raised.loop == ARDUPILOT.loop._replace(shaping=Shaping(7.5, 1.5, 3.0))
    slow = lowered(SHIPPED, PX4, {"MPC_XY_P": 0.5, "MPC_JERK_MAX": 2.0, "MPC_ACC_HOR": 2.0})
    assert slow.loop == PX4.loop._replace(position=0.5)
