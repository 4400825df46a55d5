"""Before the go a companion reads what its autopilot can follow, and plans within that."""

from __future__ import annotations

from itertools import count
from math import hypot
from struct import pack

import numpy as np
import pytest

from companion.dry_run import DryRun
from companion.flight.readiness import OPERATORS_GO
from companion.values.components import COMPONENT
from companion.values.phase import Phase
from mavlink_bridge.messages import (
    CommandAck,
    CommandInt,
    CommandLong,
    ParamRequestRead,
    ParamSet,
    SetpointLocal,
)
from outrider.onboard.status import StatusReports
from outrider.onboard.transmit_statistics import TransmitStatistics
from outrider.resources import find
from outrider.scenarios.fly_config import FlyConfig
from outrider.supervision.supervised_node import SupervisedNode
from outrider.yaml_files.yaml_file import load
from tests.companion.bench import field_of
from tests.scenarios.single_vehicle import LAND, OPERATOR, SITE, SYSTEM, TAKEOFF, TARGET, SingleVehicle

FLAVOURS = ("ardupilot", "px4")
REPOSITION = 192
REAL32 = 9


def shipped(flavour, **changes):
    """Of the shipped file, with another task; nobody tells of a target here."""
    settings = load(find("companions", flavour), FlyConfig).companion.model_dump()
    return {**settings, "task": "goto", "ground_messages": {"texts": True}, **changes}


def ready(flavour, parameters=None, **changes):
    """A vehicle with these parameters, until it waits for the go."""
    vehicle = SingleVehicle(flavour, shipped(flavour, **changes))
    put(vehicle, parameters or {})
    return vehicle.waits_for(OPERATORS_GO)


def put(vehicle, parameters):
    """Whatever the value: real firmware holds nobody to its ranges."""
    values = vehicle.autopilot._settings.values
    for name, value in parameters.items():
        values._values[values.number(name)] = value


def go_to(vehicle, east, north, up):
    latitude, longitude, altitude = SITE.to_geodetic(np.array([east, north, up]))
    x, y = round(latitude * 1e7), round(longitude * 1e7)
    nan = float("nan")
    vehicle.step(
        CommandInt(OPERATOR, SYSTEM, COMPONENT, 0, REPOSITION, (-1.0, 0.0, 0.0, nan), x, y, altitude)
    )


def said(vehicle):
    """All that was said, long texts put together again."""
    return "".join(vehicle.texts)


def plans(vehicle, seconds):
    """All that are made meanwhile."""
    made = []
    for _ in range(round(seconds * 100)):
        vehicle.step()
        plan = field_of(vehicle.companion).plan
        if plan is not None and (not made or plan is not made[-1]):
            made.append(plan)
    return made


def jerk(made, dt):
    """The greatest change of acceleration of an axis of a plan, horizontally, and from what was flown before
    it, m/s³."""
    worst = 0.0
    for plan in made:
        accelerations = plan.horizon.knots[:-1, 6:8]
        worst = max(worst, float(np.abs(np.diff(accelerations, axis=0)).max()) / dt)
        flown = plan.problem.flown
        if flown is not None and 0.0 < flown.elapsed < dt:
            first = np.abs(accelerations[0] - flown.acceleration[:2]).max()
            worst = max(worst, float(first) / flown.elapsed)
    return worst


def there_and_back(vehicle):
    """Plans of a flight that turns round on its way."""
    vehicle.fly(5.0)
    go_to(vehicle, 30.0, 10.0, 8.0)
    made = plans(vehicle, 5.0)
    go_to(vehicle, -20.0, 5.0, 6.0)
    return made + plans(vehicle, 8.0)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_stock_parameters_leave_the_shipped_file_as_it_is(flavour):
    vehicle = ready(flavour)
    found = vehicle.companion.pilot.limits
    assert (found.lowered.changes, found.lowered.lacking, found.unread) == ((), "", ())
    assert found.lowered.limits is vehicle.config.limits
    assert said(vehicle) == ""
    made = there_and_back(vehicle)
    assert 3.0 < jerk(made, 0.1) < 3.5 + 1e-6
    assert field_of(vehicle.companion).planner.config.limits == vehicle.config.limits


def test_plans_of_a_vehicle_with_less_jerk_have_less():
    vehicle = ready("ardupilot", {"PSC_JERK_XY": 2.0})
    made = there_and_back(vehicle)
    assert len(made) > 500
    assert 1.2 < jerk(made, 0.1) < 1.4 + 1e-6
    assert said(vehicle) == "Limits lowered to the autopilot's: j_max 1.4 m/s3 (PSC_JERK_XY 2)"
    assert field_of(vehicle.companion).planner.config.limits.u_max == vehicle.config.limits.u_max


@pytest.mark.parametrize(
    ("flavour", "parameters"),
    [
        ("ardupilot", {"WPNAV_SPEED": 200.0, "WPNAV_SPEED_DN": 50.0, "ANGLE_MAX": 1200.0}),
        ("px4", {"MPC_XY_VEL_MAX": 2.0, "MPC_Z_VEL_MAX_DN": 0.5, "MPC_TILTMAX_AIR": 12.0}),
    ],
)
def test_plans_keep_the_speeds_and_the_tilt_of_the_vehicle(flavour, parameters):
    # Without compensation set-points are the plan's, and without the blend no plan begins beside one.
    changes = {"tracking": {}, "guard": {"tube": 100.0}}
    vehicle = ready(flavour, parameters, **changes)
    room = 0.9 * 9.80665 * np.tan(np.radians(12.0))
    made = there_and_back(vehicle)
    speeds = np.concatenate([plan.horizon.knots[:, 3:6] for plan in made])
    # A limit that the jerk does not let be kept is widened a little.
    assert 1.8 < np.hypot(*speeds[:, :2].T).max() < 1.005 * 2.0
    assert 0.4 < np.abs(speeds[:, 2]).max() < 1.005 * 0.5
    accelerations = np.concatenate([plan.horizon.knots[:-1, 6:9] for plan in made])
    assert np.linalg.norm(accelerations, axis=1).max() < room + 1e-3
    sent = [m for _, _, m in vehicle.sent if isinstance(m, SetpointLocal)]
    assert max(hypot(*m.acceleration[:2]) for m in sent) < room + 1e-3
    text = said(vehicle)
    assert text.startswith("Limits lowered to the autopilot's: a_total 1.88 m/s2 (")
    assert all(f"{name} {value:g}" in text for name, value in parameters.items())


@pytest.mark.parametrize(
    ("flavour", "name", "value", "usual"),
    [("ardupilot", "PSC_JERK_XY", 0.5, 5.0), ("px4", "MPC_XY_P", 0.1, 0.95)],
)
def test_a_vehicle_that_cannot_follow_is_refused_until_it_is_set_up(flavour, name, value, usual):
    vehicle = SingleVehicle(flavour, shipped(flavour))
    put(vehicle, {name: value})
    lacking = {
        "ardupilot": "a jerk of 1 m/s³ at least: PSC_JERK_XY 0.5 gives 0.5",
        "px4": "a position gain of 0.3 1/s at least: MPC_XY_P 0.1 gives 0.1",
    }[flavour]
    vehicle.waits_for(lacking)
    vehicle.order(TAKEOFF, 0, 0, 0, 0, 0, 0, 5.0)
    assert [m.result for _, link, m in vehicle.sent if link == "ground" and isinstance(m, CommandAck)] == [2]
    vehicle.run(20.0)
    assert vehicle.phase is Phase.CONNECT
    assert not vehicle.autopilot.armed
    assert said(vehicle) == f"No go: an escort needs {lacking}".replace("³", "3")
    # A ground station sets it as it was: heard at once, as the autopilot answers everybody.
    vehicle.tell(ParamSet(OPERATOR, pack("<f", usual), SYSTEM, 1, name, REAL32))
    vehicle.waits_for(OPERATORS_GO, 0.2)
    vehicle.fly()


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_an_autopilot_that_tells_nothing_is_taken_for_stock_and_that_is_said(flavour):
    vehicle = SingleVehicle(flavour, shipped(flavour))
    vehicle.secretive = True
    vehicle.waits_for("the autopilot's parameters")
    vehicle.waits_for(OPERATORS_GO)
    asked = [at for at, _, m in vehicle.sent if isinstance(m, ParamRequestRead)]
    assert vehicle.now - asked[0] == pytest.approx(5e6, abs=5e4)
    assert said(vehicle.run(1.0)) == "Autopilot does not tell any parameter: stock values assumed"
    found = vehicle.companion.pilot.limits
    assert found.lowered.limits is vehicle.config.limits
    assert "WPNAV_SPEED" in found.unread or "MPC_ACC_HOR" in found.unread
    assert vehicle.fly().run(2.0).autopilot.airborne


def test_nothing_is_asked_where_nothing_is_to_be_lowered():
    """So that flights of other files send the same bytes as before."""
    vehicle = ready("ardupilot", {"PSC_JERK_XY": 0.5}, limits_from_autopilot=False)
    assert not [m for _, _, m in vehicle.sent if isinstance(m, ParamRequestRead)]
    assert jerk(there_and_back(vehicle), 0.1) > 3.0


def test_in_flight_nothing_is_asked_and_nothing_changes():
    vehicle = ready("ardupilot", {"PSC_JERK_XY": 2.0})
    vehicle.fly()
    begun = vehicle.now
    vehicle.tell(ParamSet(OPERATOR, pack("<f", 4.0), SYSTEM, 1, "PSC_JERK_XY", REAL32))
    vehicle.run(20.0)
    assert not [m for at, _, m in vehicle.sent if at >= begun and isinstance(m, ParamRequestRead)]
    assert field_of(vehicle.companion).planner.config.limits.j_max[:2] == (1.4, 1.4)
    vehicle.order(LAND)
    vehicle.until(Phase.DONE)
    vehicle.replace_companion()
    vehicle.waits_for(OPERATORS_GO)
    assert vehicle.companion.pilot.limits.lowered.changes == ("j_max 2.8 m/s³ (PSC_JERK_XY 4)",)


def test_what_is_changed_before_the_go_counts():
    vehicle = ready("ardupilot", {"PSC_JERK_XY": 2.0})
    vehicle.tell(ParamSet(OPERATOR, pack("<f", 5.0), SYSTEM, 1, "PSC_JERK_XY", REAL32))
    vehicle.run(1.0)
    assert said(vehicle).endswith("j_max 1.4 m/s3 (PSC_JERK_XY 2)Limits are the file's again")
    made = there_and_back(vehicle)
    assert 3.0 < jerk(made, 0.1) < 3.5 + 1e-6


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_dry_run_reads_them_too(flavour):
    vehicle = SingleVehicle(flavour, shipped(flavour))
    put(vehicle, {"PSC_JERK_XY": 0.5} if flavour == "ardupilot" else {"MPC_ACC_HOR": 0.5})
    stopwatch = count()
    vehicle.companion = DryRun(vehicle.config, SYSTEM, TARGET, SITE, lambda: next(stopwatch))
    vehicle.run(10.0)
    assert "at least: " in vehicle.companion.pilot.lacking
    assert any(isinstance(m, ParamRequestRead) for _, _, m in vehicle.sent)
    commands = {m.command for _, _, m in vehicle.sent if isinstance(m, CommandLong)}
    assert commands <= {511, 512}


def test_the_diary_of_fly_has_it_once():
    vehicle = SingleVehicle("ardupilot", shipped("ardupilot"))
    put(vehicle, {"PSC_JERK_XY": 2.0})
    told = []
    supervised = SupervisedNode(vehicle.companion, None, None, None)
    news = StatusReports(
        supervised, TransmitStatistics(vehicle.config.limits), None, None, lambda **one: told.append(one)
    )
    for _ in range(1000):
        vehicle.step()
        news.look(vehicle.now, vehicle.now)
    assert [one["text"] for one in told if one.get("what") == "limits"] == [
        "Limits lowered to the autopilot's: j_max 1.4 m/s³ (PSC_JERK_XY 2)"
    ]
