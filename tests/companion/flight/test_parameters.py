"""Parameters are asked for until they are heard, and not for ever."""

from __future__ import annotations

from struct import pack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.autopilots.limits import stock_parameters
from companion.flight.parameters import PATIENCE, Parameters
from mavlink_bridge.messages import ParamRequestRead, ParamValue, Source
from tests.companion.bench import AUTOPILOT, PROFILES, START

OWN = Source(11, 195)
TICK = 20_000
REAL32, INT32 = 9, 6
ARDUPILOT = PROFILES["ardupilot"]


def told(name, value, kind=REAL32, layout="<f"):
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


@given(missing=st.sets(st.sampled_from(sorted(stock_parameters(3))), min_size=1))
def test_what_is_not_answered_is_asked_for_twice_a_second_until_time_is_over(missing):
    asker = Asker(answers=set(stock_parameters(3)) - missing)
    asker.run(1e-6 * PATIENCE)
    assert asker.settled
    again = [name for time, name in asker.asked if time > 0]
    assert set(again) == missing
    assert len(again) == 9 * len(missing)
    assert set(asker.parameters.unread(ARDUPILOT)) == missing
    # One that comes after all counts.
    late = min(missing)
    asker.parameters.receive(told(late, 1.5), ARDUPILOT)
    assert asker.parameters.values[late] == 1.5


def test_before_time_is_over_one_missing_parameter_keeps_it_open():
    asker = Asker(answers=set(stock_parameters(3)) - {"PSC_JERK_XY"}).run(1e-6 * PATIENCE - 0.1)
    assert not asker.settled
    asker.parameters.receive(told("PSC_JERK_XY", 5.0), ARDUPILOT)
    assert asker.settled


def test_once_forgotten_it_is_asked_for_anew():
    asker = Asker(answers=stock_parameters(3)).run(1.0)
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
        parameters.receive(told("MPC_XY_P", 1, INT32, "<i"), profile)
        assert parameters.values == {"MPC_XY_P": 1.0}
    else:
        parameters.receive(told("ANGLE_MAX", 3000.0, 4), profile)
        assert parameters.values == {"ANGLE_MAX": 3000.0}


def test_what_is_not_finite_or_not_wanted_is_not_kept():
    parameters = Parameters(OWN)
    for name, value in (("PSC_JERK_XY", float("nan")), ("WPNAV_ACCEL", float("inf")), ("RTL_ALT", 3.0)):
        parameters.receive(told(name, value), ARDUPILOT)
    assert not parameters.values
