"""Parameters of the firmwares' position controllers: set on a vehicle that flies as its firmware, they act at
once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as dialect

from sitl.autopilot.parameters import ardupilot, px4
from sitl.autopilot.parameters.parameter import Parameter
from tests.sitl.autopilot_rig import FLAVOURS, POSITION_YAW, Rig, setpoint
from tests.sitl.outside_client import Client, only

TABLES = {"ardupilot": ardupilot.table(6), "px4": px4.table(6)}
ALL_BUT_YAW_RATE = 0x800
UNBOUND = {"filter_hz"}
"""Gains that are no parameter in the tables."""
REAL32 = 9
INT16 = 4
START = (0.0, 0.0, -10.0)
Rows = NDArray[np.float64]


def bound(flavour: str) -> dict[str, Parameter]:
    group = f"{flavour}."
    return {
        p.bound.setting.removeprefix(group): p
        for p in TABLES[flavour]
        if p.bound and p.bound.setting.startswith(group)
    }


def flying(flavour: str, values: dict[str, float], response: str = "firmware") -> Rig:
    """Hovering at 10 m and following set-points there; what is set is set in flight."""
    rig = Rig(flavour, response=response, start_height=10.0, tick=10_000)
    rig.run(2.0)
    rig.steer(1.0, setpoint(POSITION_YAW, position=START))
    client = Client(rig)
    for name, value in values.items():
        kind = next(p.kind.value for p in TABLES[flavour] if p.name == name)
        message = dialect.MAVLink_param_set_message(11, 1, name.encode(), value, kind)
        assert only(client.send(message), "PARAM_VALUE").param_value == pytest.approx(value)
    return rig


def stepped(flavour: str, values: dict[str, float], goal: tuple[float, float, float], seconds: float) -> Rows:
    """Position and velocity (n, 6), 50 a second, after a step of the set-point."""
    rig = flying(flavour, values)
    message = setpoint(POSITION_YAW, position=goal)
    rows = []
    for _ in range(round(seconds * 50.0)):
        rig.step(message)
        rig.step()
        state = rig.autopilot.state
        rows.append((*state.position, *state.velocity))
    return np.array(rows)


def reversed_at(flavour: str, values: dict[str, float], response: str = "firmware") -> tuple[float, float]:
    """When (s) the vehicle turned round that was to, and how far (m) it got beyond where it was to turn. It
    flies north for 4 s and then, with an acceleration of 3 m/s² for 2 s, back."""
    rig = flying(flavour, {}, response)
    client = Client(rig)
    turned, furthest = np.inf, -np.inf
    place, speed, goal = 0.0, 0.0, -np.inf
    for k in range(500):
        t = 0.02 * k
        push = 1.5 if t < 2.0 else 0.0 if t < 4.0 else -3.0 if t < 6.0 else 0.0
        if k == 190:
            for name, value in values.items():
                client.send(dialect.MAVLink_param_set_message(11, 1, name.encode(), value, REAL32))
        rig.step(
            setpoint(ALL_BUT_YAW_RATE, (place, 0.0, START[2]), (speed, 0.0, 0.0), (push, 0.0, 0.0), yaw=0.0)
        )
        rig.step()
        place, speed = place + 0.02 * speed + 0.0002 * push, speed + 0.02 * push
        state = rig.autopilot.state
        goal, furthest = max(goal, place), max(furthest, float(state.position[0]))
        if t > 4.0 and turned == np.inf and state.velocity[0] < 0.0:
            turned = t
    return turned, furthest - goal


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_every_gain_is_a_parameter_and_begins_as_the_firmwares_default(flavour: str) -> None:
    config = Rig(flavour).config
    gains = getattr(config, flavour)
    found = bound(flavour)
    assert set(found) == set(type(gains).model_fields) - UNBOUND
    client = Client(Rig(flavour))
    for setting, p in found.items():
        message = dialect.MAVLink_param_request_read_message(11, 1, p.name.encode(), -1)
        value = only(client.send(message), "PARAM_VALUE").param_value
        assert value == pytest.approx(p.default, rel=1e-6), setting


def test_less_jerk_makes_the_vehicle_follow_a_reversal_later() -> None:
    stock, slow, quick = (
        reversed_at("ardupilot", values) for values in ({}, {"PSC_JERK_XY": 1.0}, {"PSC_JERK_XY": 20.0})
    )
    assert slow[0] > stock[0] + 0.5
    assert slow[1] > stock[1] + 1.0
    assert quick[0] < stock[0] - 0.1
    assert quick[1] < stock[1] - 0.3


def test_slow_filters_of_the_climb_make_it_late() -> None:
    stock, velocity, throttle = (
        stepped("ardupilot", values, ABOVE, 1.6)[-1, 2]
        for values in ({}, {"PSC_VELZ_FLTE": 0.1}, {"PSC_ACCZ_FLTE": 1.0})
    )
    assert velocity > stock + 0.05
    assert abs(throttle - stock) > 0.01


def test_with_the_exact_response_it_does_nothing() -> None:
    quick, slow = (reversed_at("ardupilot", {"PSC_JERK_XY": jerk}, "exact") for jerk in (20.0, 1.0))
    assert quick == slow


NEAR = (4.0, 0.0, -10.0)
NORTH = (20.0, 0.0, -10.0)
ABOVE = (0.0, 0.0, -25.0)


@pytest.mark.parametrize(
    ("flavour", "name", "value", "axis", "most"),
    [
        ("ardupilot", "WPNAV_SPEED", 200.0, 0, 2.0),
        ("ardupilot", "WPNAV_SPEED_UP", 100.0, 2, 1.0),
        ("px4", "MPC_XY_VEL_MAX", 2.0, 0, 2.0),
        ("px4", "MPC_Z_VEL_MAX_UP", 1.0, 2, 1.0),
    ],
)
def test_a_step_is_chased_no_faster_than_the_parameter_says(
    flavour: str, name: str, value: float, axis: int, most: float
) -> None:
    goal = ABOVE if axis == 2 else NORTH
    stock, slow = (
        np.abs(stepped(flavour, values, goal, 6.0)[:, 3 + axis]).max() for values in ({}, {name: value})
    )
    assert stock > 1.4 * most
    assert 0.8 * most < slow < 1.3 * most


@pytest.mark.parametrize(
    ("flavour", "values", "calmer"),
    [
        ("ardupilot", {"WPNAV_ACCEL": 80.0}, True),
        ("ardupilot", {"PSC_JERK_XY": 1.0}, True),
        ("ardupilot", {"WPNAV_ACCEL": 500.0, "PSC_JERK_XY": 20.0}, False),
        ("px4", {"MPC_XY_P": 0.4}, True),
        ("px4", {"MPC_XY_P": 2.0}, False),
    ],
)
def test_gains_and_limits_say_how_soon_a_step_is_made(
    flavour: str, values: dict[str, float], calmer: bool
) -> None:
    """After 1.6 s it has come less far, or further, than with the stock parameters."""
    stock, other = (stepped(flavour, some, NEAR, 1.6)[-1, 0] for some in ({}, values))
    assert (other < 0.85 * stock) if calmer else (other > 1.05 * stock)


@pytest.mark.parametrize(
    ("flavour", "values", "degrees"),
    [
        ("ardupilot", {"ANGLE_MAX": 1000.0, "WPNAV_ACCEL": 500.0, "PSC_JERK_XY": 20.0}, 10.0),
        ("px4", {"MPC_TILTMAX_AIR": 20.0}, 20.0),
    ],
)
def test_it_leans_no_further_than_the_parameter_says(
    flavour: str, values: dict[str, Any], degrees: float
) -> None:
    rows = stepped(flavour, values, (60.0, 0.0, -10.0), 1.5)
    # Over half a second: drag is small at first, and only slows it. The airframe overshoots a little.
    gained = (rows[25:, 3] - rows[:-25, 3]).max() / 0.5
    most = 9.80665 * np.tan(np.radians(degrees))
    assert 0.7 * most < gained < 1.1 * most
