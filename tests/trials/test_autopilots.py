"""What ``--autopilots`` names: every vehicle in order, and a clear word for what cannot be flown."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.errors import InputError
from trials.autopilots import MOST, USUAL, Program, Running, autopilots


def test_a_program_is_started_five_times() -> None:
    words = ("--model", "quad", "--defaults", "my parameters.parm")
    found = autopilots(["arducopter:~/sitl/arducopter --model quad --defaults 'my parameters.parm'"])
    assert found == (Program("ardupilot", "~/sitl/arducopter", words),) * USUAL


def test_a_px4_may_have_settings_behind_it() -> None:
    (one, *_) = autopilots(["px4:build/px4_sitl_default PX4_PARAM_MPC_ACC_HOR=3"])
    assert one == Program("px4", "build/px4_sitl_default", ("PX4_PARAM_MPC_ACC_HOR=3",))


def test_the_order_of_a_mixed_fleet_is_that_of_the_options() -> None:
    found = autopilots(["3*arducopter:a", "2*px4:b"])
    assert [one.flavour for one in found] == ["ardupilot"] * 3 + ["px4"] * 2


def test_what_runs_is_told_by_endpoints_and_the_truth_by_those_beside() -> None:
    found = autopilots(["tcp:127.0.0.1:5760,tcp:127.0.0.1:5770,udpin:127.0.0.1:14542"])
    assert found == (
        Running("ardupilot", "tcp:127.0.0.1:5760", "tcp:127.0.0.1:5762"),
        Running("ardupilot", "tcp:127.0.0.1:5770", "tcp:127.0.0.1:5772"),
        Running("px4", "udpin:127.0.0.1:14542", "udpin:127.0.0.1:14550"),
    )


def test_flavour_and_place_of_the_truth_may_be_said() -> None:
    found = autopilots(
        ["ardupilot=udpin:127.0.0.1:14551@tcp:127.0.0.1:5763,tcp:[::1]:5760@udpin:[::1]:14550,[::1]:18570"]
    )
    assert found == (
        Running("ardupilot", "udpin:127.0.0.1:14551", "tcp:127.0.0.1:5763"),
        Running("ardupilot", "tcp:[::1]:5760", "udpin:[::1]:14550,[::1]:18570"),
    )


@given(st.integers(1, MOST - 1), st.integers(1, MOST - 1))
def test_so_many_fly_as_are_asked_for_or_it_is_refused(first: int, second: int) -> None:
    texts = [f"{first}*arducopter:a", f"{second}*px4:b"]
    if first + second <= MOST:
        assert len(autopilots(texts)) == first + second
    else:
        with pytest.raises(InputError, match=f"{first + second} vehicles; a trial has 2 to {MOST}"):
            autopilots(texts)


@pytest.mark.parametrize(
    ("texts", "why"),
    [
        (["arducopter:"], "the path is missing; the form is arducopter:PATH"),
        (["arducopter:a", "2*px4:b"], "say how many of each there are: 3\\*arducopter:a"),
        (["0*px4:b"], "'0' is no number of vehicles; allowed are 1 to 9"),
        (["many*px4:b"], "'many' is no number of vehicles"),
        (["arducopter:'a"], "quotation marks do not match"),
        (["arducoptr"], "allowed are arducopter:PATH ARGUMENTS, px4:PATH"),
        (["tcp:127.0.0.1:5760"], "one vehicle; a trial has 2 to 9"),
        (["tcp:127.0.0.1:5760,tcp:127.0.0.1:5760"], "tcp:127.0.0.1:5760 is named twice"),
        (["tcp:127.0.0.1"], "the port is missing|no endpoint|the host is missing"),
        (["/dev/ttyACM0,57600,tcp:127.0.0.1:5760"], "a trial arms and takes off with nobody asked"),
        (["mcast:,127.0.0.1,tcp:127.0.0.1:5760"], "is no simulation's"),
        (["ardupilot=udpin:127.0.0.1:14551,tcp:127.0.0.1:5760"], "where the truth of .* is told is missing"),
        (["tcp:127.0.0.1:5760@5762,tcp:127.0.0.1:5770"], "allowed are arducopter:PATH"),
    ],
)
def test_what_cannot_be_flown_is_named(texts: list[str], why: str) -> None:
    with pytest.raises(InputError, match=why):
        autopilots(texts)
