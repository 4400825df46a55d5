"""Settling, landing, and what a landed vehicle is asked, for both autopilots."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.values.phase import Phase
from tests.companion.bench import FLAVOURS, ORIGIN_REQUEST, PROFILES
from tests.companion.flight.rig import HEALTHY, HEIGHT, ILL, READY, Rig, beat, landed, state

OFFBOARD, HOLD, AUTO_LAND = 6 << 16, 4 << 16 | 3 << 24, 4 << 16 | 6 << 24


def down(flavour):
    """Landing, told to, and some seconds later."""
    rig = Rig(flavour).escorting()
    rig.pilot.land()
    rig.pilot.settled()
    landing = min(PROFILES[flavour].land_modes)
    rig.run(3.0, beat(flavour, armed=True, mode=landing), landed(4), acks=True)
    rig.sent.clear()
    return rig


@pytest.mark.parametrize("mode", [OFFBOARD, AUTO_LAND])
@pytest.mark.parametrize("acks", [True, False])
def test_a_px4_that_has_landed_is_asked_to_hold_until_it_says_so_for_five_seconds_at_most(mode, acks):
    rig = down("px4")
    assert rig.run(2.4, beat("px4", mode=mode), landed(1), acks=acks) == []
    sent = rig.run(1.0, beat("px4", mode=mode), landed(1), acks=acks)
    assert set(sent) == {(mavlink.MAV_CMD_DO_SET_MODE, (1.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0))}
    assert rig.pilot.phase is Phase.LAND
    assert rig.run(1.0, beat("px4", mode=HOLD), landed(1)) == []
    assert rig.pilot.phase is Phase.DONE
    rig = down("px4")
    rig.run(7.4, beat("px4", mode=mode), landed(1), acks=acks)
    assert rig.pilot.phase is Phase.LAND
    rig.run(0.3, beat("px4", mode=mode), landed(1), acks=acks)
    assert rig.pilot.phase is Phase.DONE


def test_after_landing_nobodys_mode_is_changed_but_the_own_and_an_arducopters_never():
    for flavour, mode in (("px4", 3 << 16), ("px4", HOLD), ("ardupilot", 9), ("ardupilot", 4)):
        rig = down(flavour)
        assert rig.run(3.0, beat(flavour, mode=mode), landed(1)) == []
        assert rig.pilot.phase is Phase.DONE


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("honest", [0, 1, 2], ids=["armed", "in the air", "both"])
def test_a_stranger_in_the_autopilots_name_does_not_end_the_flight(flavour, honest):
    """It says without a pause that the vehicle is disarmed on the ground, the autopilot says otherwise."""
    rig, mode = down(flavour), min(PROFILES[flavour].land_modes)
    truth = [[beat(flavour, armed=True, mode=mode)], [landed(2)]]
    for _ in range(20):
        rig.run(0.98, beat(flavour, mode=mode), landed(1))
        rig.run(0.02, *(truth[honest] if honest < 2 else truth[0] + truth[1]))
        assert rig.pilot.phase is Phase.LAND
    rig.run(8.0, beat(flavour, mode=mode), landed(1), acks=True)
    assert rig.pilot.phase is Phase.DONE


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_vehicle_of_unknown_landed_state_has_not_landed(flavour):
    rig = Rig(flavour).escorting()
    rig.pilot.land()
    rig.pilot.settled()
    rig.run(3.0, beat(flavour, armed=True, guided=True))
    rig.run(20.0, beat(flavour), landed(0))
    assert rig.pilot.phase is Phase.LAND


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_vehicle_that_never_tells_its_landed_state_has_landed_when_it_is_disarmed_for_ten_seconds(flavour):
    rig = Rig(flavour).escorting()
    rig.pilot.land()
    rig.pilot.settled()
    mode = PROFILES[flavour].hold_mode
    rig.run(3.0, beat(flavour, armed=True, guided=True))
    for _ in range(4):
        # A heartbeat in a stranger's name, and the autopilot's own, which contradicts it.
        rig.run(9.0, beat(flavour, mode=mode))
        rig.run(0.1, beat(flavour, armed=True, mode=min(PROFILES[flavour].land_modes)))
        assert rig.pilot.phase is Phase.LAND
    rig.run(9.8, beat(flavour, mode=mode))
    assert rig.pilot.phase is Phase.LAND
    rig.run(0.5, beat(flavour, mode=mode))
    assert rig.pilot.phase is Phase.DONE


def test_a_px4_that_falls_silent_when_it_has_landed_is_not_waited_for():
    rig = down("px4")
    rig.run(0.1, beat("px4", mode=OFFBOARD), landed(1))
    rig.run(8.0)
    assert rig.pilot.phase is Phase.DONE


@pytest.mark.parametrize("health", [HEALTHY, ILL], ids=["passes", "fails"])
@pytest.mark.parametrize("armed", [False, True])
def test_before_a_go_the_mode_is_touched_only_where_a_disarmed_px4_fails_its_checks_by_it(health, armed):
    rig = Rig("px4")
    sent = rig.run(2.0, beat("px4", armed=armed, mode=OFFBOARD), health, landed(1), acks=True)
    asked = {call for call in sent if call[0] == mavlink.MAV_CMD_DO_SET_MODE}
    assert asked == (
        {(mavlink.MAV_CMD_DO_SET_MODE, (1.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0))}
        if health is ILL and not armed
        else set()
    )
    assert ("OFFBOARD" in rig.pilot.waiting_for) == bool(asked)
    assert not rig.pilot.streaming
    # Nor in another mode.
    for flavour, mode in (("px4", HOLD), ("px4", 3 << 16), ("ardupilot", 4), ("ardupilot", 9)):
        rig = Rig(flavour)
        sent = rig.run(2.0, beat(flavour, mode=mode), ILL, landed(1))
        assert mavlink.MAV_CMD_DO_SET_MODE not in {command for command, _ in sent}
        assert rig.pilot.waiting_for == "the autopilot's pre-arm checks"


@pytest.mark.parametrize("blind", [None, state(HEIGHT, age=500_001)], ids=["nothing", "old"])
def test_who_is_blind_lands_without_settling(blind):
    rig = Rig().escorting()
    rig.pilot.land()
    rig.view = READY._replace(own=blind)
    sent = rig.run(0.1, beat("ardupilot", armed=True, guided=True))
    assert [command for command, _ in sent] == [mavlink.MAV_CMD_NAV_LAND]


def test_settling_ends():
    rig = Rig().escorting()
    rig.pilot.land()
    longest = CompanionConfig().guard.settle_us * 1e-6
    flying = beat("ardupilot", armed=True, guided=True)
    sent = rig.run(longest - 0.1, flying)
    assert {(command, params[0]) for command, params in sent} == {ORIGIN_REQUEST}
    assert [command for command, _ in rig.run(0.2, flying)] == [mavlink.MAV_CMD_NAV_LAND]


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_landing_goes_through_settling_and_ends_disarmed(flavour):
    rig = Rig(flavour).escorting()
    flying = beat(flavour, armed=True, guided=True)
    assert rig.pilot.land()
    assert rig.pilot.phase is Phase.SETTLE
    # Until it has settled it is steered, and nothing is ordered.
    assert rig.run(3.0, flying) == []
    assert rig.pilot.streaming
    rig.pilot.settled()
    assert not rig.pilot.streaming
    sent = rig.run(1.0, flying)
    assert [command for command, _ in sent] == [mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_LAND]
    landing = beat(flavour, armed=True, mode=min(PROFILES[flavour].land_modes))
    assert rig.run(40.0, landing, acks=True) == []
    assert rig.pilot.phase is Phase.LAND
    rig.run(2.6, beat(flavour), landed(1))
    assert rig.pilot.phase is Phase.DONE
    assert rig.run(5.0, beat(flavour)) == []


@pytest.mark.parametrize("phase", [p for p in Phase if p is not Phase.SETTLE])
def test_only_who_settles_can_have_settled(phase):
    rig = Rig()
    rig.pilot.phase = phase
    rig.pilot.settled()
    assert rig.pilot.phase is phase
