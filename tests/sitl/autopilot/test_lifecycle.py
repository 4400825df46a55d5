"""Arming, takeoff, guided flight, landing: what is allowed when, in both dialects."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

from mavlink_bridge.messages import CommandInt, ExtendedSysState, Heartbeat
from sitl.autopilot.firmware import Mode
from tests.sitl.autopilot_rig import (
    ARM,
    FLAVOURS,
    GUIDED,
    INTERVAL,
    LAND,
    PILOT,
    REQUEST,
    SET_MODE,
    TAKEOFF,
    Rig,
    setpoint,
)

ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
NAN = math.nan


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_whole_flight(flavour):
    rig = Rig(flavour).hover(4.0)
    assert rig.autopilot.airborne
    np.testing.assert_allclose(rig.position, [0, 0, -4], atol=0.02)
    rig.steer(8.0, setpoint(position=(6.0, -3.0, -5.0), yaw=1.0))
    np.testing.assert_allclose(rig.position, [6, -3, -5], atol=0.05)
    assert rig.order(LAND) == [ACCEPTED]
    rig.run(10.0)
    assert not rig.autopilot.armed
    assert not rig.autopilot.airborne
    assert rig.autopilot.reference is None
    np.testing.assert_allclose(rig.position, [6, -3, 0], atol=0.1)
    states = [m.landed_state for m in rig.all(ExtendedSysState)]
    changes = [a for a, b in zip(states, [*states[1:], 0], strict=True) if a != b]
    assert changes == [1, 3, 2, 4, 1]


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_heartbeat_tells_type_mode_and_armed(flavour):
    rig = Rig(flavour).hover(3.0)
    rig.steer(1.1, setpoint(position=(0.0, 0.0, -3.0)))
    first, last = rig.all(Heartbeat)[0], rig.all(Heartbeat)[-1]
    assert (first.type, first.autopilot) == (13, {"ardupilot": 3, "px4": 12}[flavour])
    assert (first.base_mode & 0x80, last.base_mode & 0x80) == (0, 0x80)
    assert first.base_mode & last.base_mode & 1
    assert last.custom_mode == {"ardupilot": 4, "px4": 6 << 16}[flavour]
    assert (first.system_status, last.system_status) == (2, 4)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_arming_waits_for_a_position(flavour):
    rig = Rig(flavour, ready_after=2.0)
    rig.run(1.9)
    assert rig.order(ARM, 1) == [REJECTED]
    assert "Arming refused: no position yet" in rig.texts
    rig.run(0.2)
    assert rig.order(ARM, 1) == [ACCEPTED]
    assert rig.autopilot.armed


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_disarming_in_flight_needs_force_and_then_it_falls(flavour):
    rig = Rig(flavour).hover(4.0)
    assert rig.order(ARM, 0) == [FAILED]
    assert "Disarming refused: flying" in rig.texts
    rig.run(1.0)
    np.testing.assert_allclose(rig.position, [0, 0, -4], atol=0.02)
    assert rig.order(ARM, 0, 21196) == [ACCEPTED]
    rig.run(2.0)
    assert not rig.autopilot.armed
    assert rig.position[2] > -0.01
    assert not rig.autopilot.airborne


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_armed_on_the_ground_does_not_last(flavour):
    rig = Rig(flavour, disarm_delay=3.0)
    rig.run(1.1)
    rig.order(ARM, 1)
    rig.run(2.9)
    assert rig.autopilot.armed
    rig.run(0.2)
    assert not rig.autopilot.armed
    assert rig.texts[-1] == "Disarmed: on the ground for too long"


class Asked(NamedTuple):
    """A command on the ground, armed or not, after these others, and what comes of it."""

    flavour: str
    before: tuple[tuple[float, ...], ...]
    command: tuple[float, ...]
    result: int
    text: str | None = None


ARMED = (ARM, 1.0)
AP, PX4 = FLAVOURS
ASKED = [
    Asked(AP, (), (TAKEOFF, 0, 0, 0, 0, 0, 0, 5), FAILED, "Takeoff needs GUIDED mode"),
    Asked(AP, ((SET_MODE, 1, 4),), (TAKEOFF, 0, 0, 0, 0, 0, 0, 5), FAILED, "Takeoff needs armed motors"),
    Asked(AP, ((SET_MODE, 1, 4), ARMED), (TAKEOFF, *[NAN] * 7), FAILED, "Takeoff needs a positive altitude"),
    Asked(AP, ((SET_MODE, 1, 4), ARMED), (TAKEOFF, 0, 0, 0, 0, 0, 0, 5), ACCEPTED),
    Asked(AP, ((SET_MODE, 129, 4),), ARMED, ACCEPTED),
    Asked(AP, ((SET_MODE, 1, 9),), ARMED, FAILED, "Arming refused: LAND mode is not armable"),
    Asked(AP, (), (SET_MODE, 1, 77), DENIED, "Mode refused: 77, 0 is not known"),
    Asked(AP, (), (SET_MODE, 1, NAN), DENIED, "Mode refused: only custom modes are known"),
    Asked(AP, (), (SET_MODE, 0, 4), DENIED, "Mode refused: only custom modes are known"),
    Asked(AP, (), (ARM, 0.5), DENIED, "Arming: parameter 1 must be 0 or 1"),
    Asked(AP, (), (INTERVAL, 32, 5000), ACCEPTED),
    Asked(AP, (), (INTERVAL, 32, 2500), FAILED, "Interval refused: 2500 us is too short"),
    Asked(AP, (), (INTERVAL, 111, 100000), DENIED, "Interval refused: no message 111"),
    Asked(AP, (), (INTERVAL, NAN, NAN), DENIED, "Interval refused: not a number"),
    Asked(AP, (), (REQUEST, 300), UNSUPPORTED, "Request refused: no message 300"),
    Asked(AP, (), (REQUEST, NAN), UNSUPPORTED, "Request refused: no message nan"),
    Asked(AP, (), (31010, 0), UNSUPPORTED, "Command 31010 is not supported"),
    Asked(PX4, (), (TAKEOFF, *[NAN] * 7), ACCEPTED),
    Asked(PX4, (ARMED,), (TAKEOFF, *[NAN] * 7), ACCEPTED),
    Asked(PX4, (ARMED,), (SET_MODE, 1, 4, 2), ACCEPTED),
    Asked(PX4, (ARMED,), (SET_MODE, 1, 4, 3), ACCEPTED),
    Asked(PX4, (), (SET_MODE, 1, 4, 9), DENIED, "Mode refused: 4, 9 is not known"),
    Asked(PX4, ((SET_MODE, 1, 4, 8),), ARMED, FAILED, "Arming refused: FOLLOW mode is not armable"),
    Asked(AP, (), (SET_MODE, 1, 23), FAILED, "Mode change to FOLLOW failed: FOLL_ENABLE is 0"),
    Asked(PX4, (ARMED,), (SET_MODE, 1, 6), REJECTED, "OFFBOARD needs set-points at more than 2 Hz"),
    Asked(PX4, (), (TAKEOFF, 0, 0, 0, 0, 0, 0, math.inf), DENIED, "Takeoff altitude is not finite"),
    Asked(PX4, ((LAND,),), ARMED, ACCEPTED),
    Asked(PX4, (), (INTERVAL, 32, 2500), ACCEPTED),
]


@pytest.mark.parametrize("case", ASKED, ids=lambda case: f"{case.flavour}-{case.command[:4]}")
def test_commands_are_acknowledged_and_refusals_explained(case):
    rig = Rig(case.flavour)
    rig.run(1.1)
    for command in case.before:
        assert rig.order(*command) == [ACCEPTED]
    rig.received.clear()
    assert rig.order(*case.command) == [case.result]
    refusals = [text for text in rig.texts if text != "Armed"]
    assert refusals == ([] if case.text is None else [case.text])


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_retried_commands_change_nothing(flavour):
    """Every command twice, some steps apart: the same flight as every command once."""
    flights = []
    for retried in (False, True):
        rig = Rig(flavour)
        rig.run(1.1)
        takeoff = (TAKEOFF, 0, 0, 0, 0, 0, 0, 3) if flavour == "ardupilot" else (TAKEOFF, *[NAN] * 7)
        mode = GUIDED["ardupilot"] if flavour == "ardupilot" else (1, 4, 3)
        for command, patience in (((SET_MODE, *mode), 0.5), (ARMED, 0.5), (takeoff, 1.0), ((LAND,), 8.0)):
            for attempt in range(2):
                if attempt == 0 or retried:
                    assert rig.order(*command) == [ACCEPTED]
                else:
                    rig.run(0.005)
                rig.run(patience)
        flights.append((rig.position.tolist(), rig.autopilot.mode, rig.autopilot.armed, rig.texts))
    assert flights[0] == flights[1]


def test_takeoff_by_command_int_counts_from_home_or_from_the_sea():
    for frame, altitude in ((6, 4.0), (5, 488.0 + 4.0)):
        rig = Rig("px4")
        rig.run(1.1)
        rig.order(ARM, 1)
        rig.step(CommandInt(PILOT, 11, 1, frame, TAKEOFF, (0.0, 0.0, 0.0, 0.0), 0, 0, altitude))
        rig.run(8.0)
        assert rig.position[2] == pytest.approx(-4.0, abs=0.02)


def test_px4_takes_off_by_set_point_and_only_upwards():
    rig = Rig("px4")
    rig.run(1.1)
    down, up = setpoint(position=(0.0, 0.0, 1.0)), setpoint(position=(0.0, 0.0, -2.0))
    rig.run(1.0, down)
    assert rig.guided() == [ACCEPTED]
    assert rig.order(ARM, 1) == [ACCEPTED]
    rig.run(1.0, down)
    assert not rig.autopilot.airborne
    rig.run(5.0, up)
    assert rig.position[2] == pytest.approx(-2.0, abs=0.02)
    assert rig.autopilot.mode is Mode.GUIDED


def test_px4_takeoff_mode_waits_for_arming():
    rig = Rig("px4")
    rig.run(1.1)
    rig.order(TAKEOFF, *[NAN] * 7)
    rig.run(1.0)
    assert not rig.autopilot.airborne
    rig.order(ARM, 1)
    rig.run(6.0)
    assert rig.position[2] == pytest.approx(-2.5, abs=0.02)
    assert rig.autopilot.mode is Mode.HOLD


def test_ardupilot_does_not_leave_the_ground_by_set_point():
    rig = Rig("ardupilot")
    rig.run(1.1)
    rig.guided()
    rig.order(ARM, 1)
    rig.run(2.0, setpoint(position=(0.0, 0.0, -5.0)))
    assert rig.position[2] == pytest.approx(0.0, abs=1e-9)
    assert rig.texts.count("Set-point ignored: landed, take off first") == 2


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_set_point_below_the_ground_ends_landed_and_disarmed(flavour):
    rig = Rig(flavour, disarm_delay=2.0).hover(2.0 if flavour == "ardupilot" else 2.5)
    rig.steer(6.0, setpoint(position=(0.0, 0.0, 1.0)))
    assert not rig.autopilot.airborne
    rig.run(2.5, setpoint(position=(0.0, 0.0, 1.0)))
    assert not rig.autopilot.armed
    assert rig.position[2] == pytest.approx(0.0, abs=1e-6)


def test_landing_on_the_ground_disarms():
    rig = Rig("ardupilot")
    rig.run(1.1)
    rig.guided()
    rig.order(ARM, 1)
    assert rig.order(LAND) == [ACCEPTED]
    assert not rig.autopilot.armed
