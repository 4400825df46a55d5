"""What an autopilot can follow, from its parameters, which are asked for until they are heard."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError, fields
from struct import pack

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilot_limits import PATIENCE, Parameters
from companion.flight.autopilots.known import KNOWN
from companion.flight.autopilots.limits import STOCK, Limits, deciding, limits_of, stock_parameters
from mavlink_bridge.messages import ParamRequestRead, ParamValue, Source
from tests.companion.bench import AUTOPILOT, PROFILES, START

ARDUPILOT, PX4 = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4
BOTH = (ARDUPILOT, PX4)
OWN = Source(11, 195)
TICK = 20_000
ANYTHING = st.floats(allow_nan=True, allow_infinity=True)


def test_stock_limits_in_si() -> None:
    ardupilot, px4 = STOCK[ARDUPILOT], STOCK[PX4]
    assert (ardupilot.jerk, ardupilot.acceleration, ardupilot.speed) == (5.0, 2.5, 10.0)
    assert math.degrees(ardupilot.tilt) == pytest.approx(30.0)
    assert (ardupilot.position_gain, ardupilot.velocity_gain, ardupilot.shaped) == (1.0, 2.0, True)
    assert (px4.jerk, px4.acceleration, px4.speed) == (8.0, 3.0, 12.0)
    assert math.degrees(px4.tilt) == pytest.approx(45.0)
    assert (px4.position_gain, px4.velocity_gain, px4.shaped) == (0.95, 1.8, False)
    assert (ardupilot.climb, ardupilot.sink, px4.climb, px4.sink) == (2.5, 1.5, 3.0, 1.5)
    assert ardupilot.tilt_acceleration == pytest.approx(5.66, abs=0.01)
    assert px4.tilt_acceleration == pytest.approx(9.81, abs=0.01)


@pytest.mark.parametrize("autopilot", BOTH)
def test_each_known_autopilot_has_limits_and_missing_parameters_are_stock(autopilot: int) -> None:
    assert set(STOCK) == set(KNOWN)
    stock = stock_parameters(autopilot)
    assert limits_of(autopilot, {}) == limits_of(autopilot, stock) == STOCK[autopilot]
    for name in stock:
        rest = {other: value for other, value in stock.items() if other != name}
        assert limits_of(autopilot, {**rest, name: math.nan, "OTHER": 3.0}) == STOCK[autopilot]


def test_an_autopilot_that_is_not_known() -> None:
    assert not stock_parameters(8)
    with pytest.raises(KeyError):
        limits_of(8, {})


@pytest.mark.parametrize(
    ("autopilot", "name", "value", "field", "limit"),
    [
        (ARDUPILOT, "PSC_JERK_XY", 1.0, "jerk", 1.0),
        (ARDUPILOT, "WPNAV_SPEED", 300.0, "speed", 3.0),
        (ARDUPILOT, "ANGLE_MAX", 2000.0, "tilt", math.radians(20.0)),
        (ARDUPILOT, "PSC_ANGLE_MAX", 25.0, "tilt", math.radians(25.0)),
        (ARDUPILOT, "PSC_POSXY_P", 0.7, "position_gain", 0.7),
        (ARDUPILOT, "PSC_VELXY_P", 1.4, "velocity_gain", 1.4),
        (ARDUPILOT, "WPNAV_SPEED_UP", 200.0, "climb", 2.0),
        (ARDUPILOT, "WPNAV_SPEED_DN", 100.0, "sink", 1.0),
        (PX4, "MPC_Z_VEL_MAX_UP", 2.0, "climb", 2.0),
        (PX4, "MPC_Z_VEL_MAX_DN", 1.0, "sink", 1.0),
        (PX4, "MPC_JERK_MAX", 4.0, "jerk", 4.0),
        (PX4, "MPC_ACC_HOR", 2.0, "acceleration", 2.0),
        (PX4, "MPC_XY_VEL_MAX", 6.0, "speed", 6.0),
        (PX4, "MPC_TILTMAX_AIR", 20.0, "tilt", math.radians(20.0)),
        (PX4, "MPC_XY_P", 0.5, "position_gain", 0.5),
        (PX4, "MPC_XY_VEL_P_ACC", 3.0, "velocity_gain", 3.0),
    ],
)
def test_a_parameter_changes_its_own_limit_only(
    autopilot: int, name: str, value: float, field: str, limit: float
) -> None:
    changed = limits_of(autopilot, {name: value})
    for one in fields(changed):
        expected = limit if one.name == field else getattr(STOCK[autopilot], one.name)
        assert getattr(changed, one.name) == pytest.approx(expected), one.name


def test_arducopter_does_not_give_more_jerk_than_its_angular_acceleration_allows() -> None:
    # Half the square root of 2.5 m/s² times 19.2 rad/s² of 1 g; 6 m/s² leave more.
    assert limits_of(ARDUPILOT, {"PSC_JERK_XY": 20.0}).jerk == pytest.approx(10.8, abs=0.05)
    more = limits_of(ARDUPILOT, {"PSC_JERK_XY": 20.0, "WPNAV_ACCEL": 600.0})
    assert more.jerk == pytest.approx(16.8, abs=0.05)
    assert more.acceleration == 6.0
    slow = limits_of(ARDUPILOT, {"ATC_ACCEL_P_MAX": 5000.0})
    assert slow.jerk == pytest.approx(0.5 * math.sqrt(2.5 * math.radians(50.0) * 9.80665))
    # 0 turns that limit off.
    assert limits_of(ARDUPILOT, {"PSC_JERK_XY": 20.0, "ATC_ACCEL_R_MAX": 0.0}).jerk == 20.0


def test_what_the_tilt_does_not_allow_is_not_usable() -> None:
    assert STOCK[ARDUPILOT].usable_acceleration == 2.5
    steep = limits_of(ARDUPILOT, {"WPNAV_ACCEL": 900.0})
    assert steep.usable_acceleration == steep.tilt_acceleration == pytest.approx(5.66, abs=0.01)
    assert limits_of(ARDUPILOT, {"WPNAV_ACCEL": 0.0}).acceleration == 2.5


def integrated(limits: Limits, speed: float) -> float:
    """The way of a stop in steps of 0.1 ms: jerk down, hold, jerk up."""
    step, way, braking = 1e-4, 0.0, 0.0
    while speed > 0.0:
        # The speed that is lost while the deceleration goes back to zero.
        ending = speed <= braking * braking / (2.0 * limits.jerk)
        change = -limits.jerk * step if ending else limits.jerk * step
        braking = min(max(braking + change, limits.jerk * step), limits.usable_acceleration)
        way += speed * step
        speed -= braking * step
    return way


@pytest.mark.parametrize("autopilot", BOTH)
@pytest.mark.parametrize("speed", [0.5, 1.0, 5.0])
@pytest.mark.parametrize("changed", [{}, {"PSC_JERK_XY": 1.0, "MPC_JERK_MAX": 1.0}, {"WPNAV_ACCEL": 50.0}])
def test_the_way_to_stop_is_that_of_a_stop_in_small_steps(
    autopilot: int, speed: float, changed: dict[str, float]
) -> None:
    limits = limits_of(autopilot, changed)
    assert limits.stopping_distance(speed) == pytest.approx(integrated(limits, speed), rel=0.01)


def test_stopping_of_the_stock_firmware() -> None:
    assert STOCK[ARDUPILOT].stopping_distance(5.0) == pytest.approx(6.25)
    assert STOCK[PX4].stopping_distance(5.0) == pytest.approx(25.0 / 6.0 + 5.0 * 3.0 / 16.0)
    assert STOCK[PX4].stopping_distance(0.0) == 0.0
    assert limits_of(PX4, {"MPC_ACC_HOR": 0.0}).stopping_distance(1.0) == math.inf


@pytest.mark.parametrize("autopilot", BOTH)
def test_each_limit_names_the_parameter_that_decides_it(autopilot: int) -> None:
    stock = stock_parameters(autopilot)
    for field in fields(Limits):
        if field.name == "shaped":
            continue
        name, value = deciding(autopilot, stock, field.name)
        assert value == stock[name]
        lower = {**stock, name: 0.4 * value}
        assert getattr(limits_of(autopilot, lower), field.name) < getattr(STOCK[autopilot], field.name)
        assert deciding(autopilot, lower, field.name) == (name, 0.4 * value)


def test_of_two_parameters_that_bound_a_limit_the_one_that_does_is_named() -> None:
    slow = {"PSC_JERK_XY": 4.0, "ATC_ACCEL_P_MAX": 5000.0}
    assert deciding(ARDUPILOT, slow, "jerk") == ("ATC_ACCEL_P_MAX", 5000.0)
    assert deciding(ARDUPILOT, {**slow, "PSC_JERK_XY": 1.0}, "jerk") == ("PSC_JERK_XY", 1.0)
    # PSC_ANGLE_MAX counts in place of ANGLE_MAX.
    tilts = {"ANGLE_MAX": 1500.0, "PSC_ANGLE_MAX": 20.0}
    assert deciding(ARDUPILOT, tilts, "tilt") == ("PSC_ANGLE_MAX", 20.0)


@pytest.mark.parametrize("autopilot", BOTH)
@given(data=st.data())
def test_whatever_a_vehicle_says_limits_are_finite_and_not_negative(
    autopilot: int, data: st.DataObject
) -> None:
    names = sorted(stock_parameters(autopilot))
    limits = limits_of(autopilot, data.draw(st.dictionaries(st.sampled_from(names), ANYTHING)))
    values = [getattr(limits, field.name) for field in fields(limits)]
    for value in (*values, limits.usable_acceleration):
        assert math.isfinite(value)
        assert value >= 0.0
    assert limits.usable_acceleration <= limits.acceleration
    with pytest.raises(FrozenInstanceError):
        limits.jerk = 1.0  # type: ignore[misc]


def told(name, value, kind=mavlink.MAV_PARAM_TYPE_REAL32, layout="<f"):
    return ParamValue(AUTOPILOT, pack(layout, value), 300, 0xFFFF, name, kind)


class Asker:
    """One that asks, and an autopilot that answers ``answers`` each time it is asked."""

    def __init__(self, flavour="ardupilot", answers=()):
        self.profile, self.answers = PROFILES[flavour], answers
        self.parameters, self.now = Parameters(OWN), START
        self.asked = []

    def run(self, seconds):
        for _ in range(round(seconds * 1e6 / TICK)):
            for one in self.parameters.requests(self.now, self.profile):
                assert isinstance(one, ParamRequestRead)
                assert (one.source, one.number, one.target_system, one.target_component) == (OWN, -1, 11, 1)
                self.asked.append((self.now - START, one.name))
                if one.name in self.answers:
                    value = stock_parameters(self.profile.autopilot)[one.name]
                    self.parameters.receive(told(one.name, value), self.profile)
            self.now += TICK
        return self

    @property
    def settled(self):
        return self.parameters.settled(self.now, self.profile)


@pytest.mark.parametrize("flavour", PROFILES)
def test_all_that_decides_the_limits_is_asked_for_at_once_and_then_seldom(flavour):
    stock = stock_parameters(PROFILES[flavour].autopilot)
    asker = Asker(flavour, stock).run(60.0)
    assert asker.settled
    assert asker.parameters.values == pytest.approx(dict(stock))
    times = sorted({time for time, _ in asker.asked})
    assert len(asker.asked) == len(times) * len(stock)
    assert times[0] == 0
    # Somebody may change a parameter before the go.
    assert {round(1e-6 * time) for time in times} == {0, 10, 20, 30, 40, 50}


@given(missing=st.sets(st.sampled_from(sorted(stock_parameters(ARDUPILOT))), min_size=1))
def test_what_is_not_answered_is_asked_for_twice_a_second_until_time_is_over(missing):
    asker = Asker(answers=set(stock_parameters(ARDUPILOT)) - missing)
    asker.run(1e-6 * PATIENCE)
    assert asker.settled
    again = [name for time, name in asker.asked if time > 0]
    assert set(again) == missing
    assert len(again) == 9 * len(missing)
    assert set(asker.parameters.unread(PROFILES["ardupilot"])) == missing
    # One that comes after all counts.
    late = min(missing)
    asker.parameters.receive(told(late, 1.5), PROFILES["ardupilot"])
    assert asker.parameters.values[late] == 1.5


def test_before_time_is_over_one_missing_parameter_keeps_it_open():
    asker = Asker(answers=set(stock_parameters(ARDUPILOT)) - {"PSC_JERK_XY"}).run(1e-6 * PATIENCE - 0.1)
    assert not asker.settled
    asker.parameters.receive(told("PSC_JERK_XY", 5.0), PROFILES["ardupilot"])
    assert asker.settled


def test_once_forgotten_it_is_asked_for_anew():
    asker = Asker(answers=stock_parameters(ARDUPILOT)).run(1.0)
    before = len(asker.asked)
    asker.parameters.forget()
    assert not asker.settled
    assert not asker.parameters.values
    assert len(asker.run(0.1).asked) == 2 * before


@pytest.mark.parametrize("flavour", PROFILES)
def test_a_number_is_read_as_its_firmware_means_it(flavour):
    """ArduPilot casts an int16 to float32, PX4 sends the bytes of an integer."""
    parameters, profile = Parameters(OWN), PROFILES[flavour]
    if flavour == "px4":
        parameters.receive(told("MPC_XY_P", 1, mavlink.MAV_PARAM_TYPE_INT32, "<i"), profile)
        assert parameters.values == {"MPC_XY_P": 1.0}
    else:
        parameters.receive(told("ANGLE_MAX", 3000.0, mavlink.MAV_PARAM_TYPE_INT16), profile)
        assert parameters.values == {"ANGLE_MAX": 3000.0}


def test_what_is_not_finite_or_not_wanted_is_not_kept():
    parameters = Parameters(OWN)
    for name, value in (("PSC_JERK_XY", float("nan")), ("WPNAV_ACCEL", float("inf")), ("RTL_ALT", 3.0)):
        parameters.receive(told(name, value), PROFILES["ardupilot"])
    assert not parameters.values
