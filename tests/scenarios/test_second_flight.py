"""A vehicle that has landed is ready for the next flight, of the same companion or of another one."""

from __future__ import annotations

import pytest

from companion.values.phase import Phase
from mavlink_bridge.messages import CommandLong, SetpointLocal, SysStatus
from sitl.autopilot.firmware import Mode
from tests.scenarios.single_vehicle import LAND, MODE, OPERATOR, SYSTEM, SingleVehicle

PREARM = 0x10000000


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_two_flights_in_a_row(flavour):
    vehicle = SingleVehicle(flavour)
    for flight in range(3):
        if flight:
            vehicle.replace_companion()
        vehicle.fly().run(1.0)
        assert vehicle.autopilot.airborne
        vehicle.order(LAND)
        vehicle.until(Phase.DONE)
        assert not vehicle.autopilot.armed
        assert vehicle.autopilot.mode is not Mode.GUIDED
        vehicle.run(2.0)
        assert vehicle.all(SysStatus)[-1].health & PREARM


def test_a_px4_that_is_found_disarmed_in_offboard_is_asked_to_hold_and_then_ready():
    """Without set-points: whoever arms it there must not see it fly."""
    vehicle = SingleVehicle("px4").run(3.0)
    vehicle.command(MODE, 1, 6)
    assert vehicle.autopilot.mode is Mode.GUIDED
    waited = set()
    for _ in range(600):
        vehicle.step()
        waited.add(vehicle.companion.pilot.waiting_for)
    assert "the autopilot's pre-arm checks, which fail in OFFBOARD without set-points: HOLD first" in waited
    assert vehicle.autopilot.mode is Mode.HOLD
    assert not any(isinstance(message, SetpointLocal) for _, _, message in vehicle.sent)
    vehicle.fly()


def test_where_somebody_elses_set_points_flow_already_the_mode_is_theirs():
    vehicle = SingleVehicle("px4").run(3.0)
    theirs = SetpointLocal(
        OPERATOR, 0, SYSTEM, 1, 1, 0x9F8, (0.0, 0.0, 1.0), (0.0,) * 3, (0.0,) * 3, 0.0, 0.0
    )
    for k in range(500):
        vehicle.tell(theirs)
        if k == 100:
            vehicle.command(MODE, 1, 6)
    assert vehicle.autopilot.mode is Mode.GUIDED
    assert vehicle.companion.pilot.waiting_for == "the operator's go"


def test_who_chose_another_mode_after_landing_keeps_it():
    vehicle = SingleVehicle("px4").fly()
    vehicle.order(LAND)
    for _ in range(4000):
        vehicle.step()
        if not vehicle.autopilot.armed:
            break
    vehicle.command(MODE, 1, 3)
    before = len(vehicle.sent)
    vehicle.until(Phase.DONE).run(3.0)
    assert vehicle.autopilot.mode is Mode.POSITION
    orders = [m for _, _, m in vehicle.sent[before:] if isinstance(m, CommandLong) and m.command == MODE]
    assert orders == []
