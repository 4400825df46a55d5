"""GPS lost, regained, shifted, as ArduPilot and PX4 take it."""

from __future__ import annotations

import numpy as np
import pytest

from mavlink_bridge.messages import (
    Attitude,
    EkfStatus,
    GlobalPosition,
    GpsGlobalOrigin,
    Heartbeat,
    LocalPosition,
    SysStatus,
)
from sitl.autopilot.firmware import Mode
from sitl.environment.weather import WeatherConfig
from sitl.node import Autopilot
from tests.sitl.autopilot_rig import ALL, ARM, FIREFLY, FLAVOURS, SITE, Rig, setpoint

HERE = setpoint(ALL, (0.0, 0.0, -20.0))
PATIENCE = {"ardupilot": 7.0, "px4": 5.0}
TEXTS = {"ardupilot": "EKF Failsafe: changed to LAND Mode", "px4": "Failsafe: no position, blind land"}


def hovering(flavour="ardupilot", weather=None, **settings):
    rig = Rig(flavour, start_height=20.0, **settings)
    rig.autopilot = Autopilot(rig.config, FIREFLY, SITE, 1, weather)
    rig.steer(2.0, HERE)
    return rig


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_it_coasts_as_long_as_its_filter_trusts_itself_and_lands_blind(flavour):
    rig = hovering(flavour)
    rig.autopilot.lose_gps()
    rig.received.clear()
    rig.run(PATIENCE[flavour] - 0.1, HERE)
    assert rig.autopilot.mode is Mode.GUIDED
    told = [len(rig.all(kind)) for kind in (LocalPosition, GlobalPosition)]
    assert min(told) > 40
    assert {m.flags & 0x10 for m in rig.all(EkfStatus)} <= {0x10}
    assert rig.all(SysStatus)[-1].health & 0x20 == 0
    drift = rig.autopilot.estimate_error
    np.testing.assert_allclose(rig.position + drift, (0.0, 0.0, -20.0), atol=0.05)
    assert np.linalg.norm(drift[:2]) > 0.3
    assert abs(drift[2]) < 1e-9

    rig.run(0.2, HERE)
    told = [len(rig.all(kind)) for kind in (LocalPosition, GlobalPosition)]
    rig.run(1.5, HERE)
    assert rig.autopilot.mode is Mode.LAND
    assert TEXTS[flavour] in rig.texts
    assert [len(rig.all(kind)) for kind in (LocalPosition, GlobalPosition)] == told
    rig.received.clear()
    rig.run(1.5)
    assert len(rig.all(Attitude)) >= 70
    assert {m.flags & 0x1FF for m in rig.all(EkfStatus)} <= {0xA5}
    assert rig.all(Heartbeat)[-1].system_status == 5
    rig.run(30.0, HERE)
    assert not rig.autopilot.armed
    assert rig.position[2] == pytest.approx(0.0, abs=1e-6)
    assert rig.all(GpsGlobalOrigin)


def test_blind_it_goes_where_the_air_goes():
    """Level, with nothing but drag to move it: it gains on the wind by D/m of what it lacks.

    For rotors level with the centre of mass; else the drag also turns it, which attitude control without an
    integral lets it do a little.
    """
    rotors = tuple(rotor.model_copy(update={"z": 0.0}) for rotor in FIREFLY.rotors)
    level = FIREFLY.model_copy(update={"rotors": rotors, "rolling_moment": 0.0})
    rig = Rig("ardupilot", start_height=20.0)
    rig.autopilot = Autopilot(rig.config, level, SITE, 1, WeatherConfig(wind=(0.0, 4.0, 0.0)))
    rig.steer(2.0, HERE)
    rig.autopilot.lose_gps()
    rig.run(7.2)
    start = rig.autopilot.state.velocity[0]
    rig.run(8.0)
    gained = rig.autopilot.state.velocity[0] - start
    drag = 6 * level.rotor_drag * 544.0 / level.mass
    assert gained == pytest.approx((4.0 - start) * -np.expm1(-8.0 * drag), rel=0.05)
    assert abs(rig.autopilot.state.velocity[1]) < 0.5


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_gps_that_comes_back_in_time_is_as_if_nothing_had_been(flavour):
    rig = hovering(flavour)
    rig.autopilot.lose_gps()
    rig.run(4.0, HERE)
    assert np.linalg.norm(rig.position[:2]) > 0.2
    rig.autopilot.regain_gps()
    rig.run(15.0, HERE)
    assert rig.autopilot.mode is Mode.GUIDED
    np.testing.assert_allclose(rig.position, (0.0, 0.0, -20.0), atol=2e-3)
    assert rig.autopilot.estimate_error.tolist() == [0.0, 0.0, 0.0]
    assert rig.all(SysStatus)[-1].health & 0x20


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_gps_that_comes_back_late_jumps_the_estimate_and_not_the_vehicle(flavour):
    rig = hovering(flavour)
    rig.autopilot.lose_gps()
    rig.run(10.0, HERE)
    assert np.linalg.norm(rig.autopilot.estimate_error) > 0.8
    rig.autopilot.regain_gps()
    place, fastest = rig.position, 0.0
    for _ in range(400):
        rig.step()
        fastest = max(fastest, float(np.linalg.norm(rig.autopilot.state.velocity[:2])))
    assert rig.autopilot.estimate_error.tolist() == [0.0, 0.0, 0.0]
    assert rig.autopilot.mode is Mode.LAND
    assert fastest < 0.6
    np.testing.assert_allclose(rig.position[:2], place[:2], atol=0.6)
    rig.steer(15.0, HERE)
    np.testing.assert_allclose(rig.position, (0.0, 0.0, -20.0), atol=5e-3)


@pytest.mark.parametrize(("metres", "by"), [(2.0, 8.0), (8.0, 16.0)])
def test_a_shifted_gps_shifts_the_vehicle_the_other_way(metres, by):
    """Two metres east at once; eight after having been refused for seven seconds, without a lurch."""
    rig = hovering()
    rig.autopilot.shift_gps((metres, 0.0, 0.0))
    rig.run(0.5, HERE)
    assert (rig.autopilot.estimate_error[1] > 0.5) == (metres < 3.5)
    rig.run(6.3, HERE)
    if metres > 3.5:
        np.testing.assert_allclose(rig.position, (0.0, 0.0, -20.0), atol=1e-3)
        assert rig.autopilot.estimate_error.tolist() == [0.0, 0.0, 0.0]
    fastest = 0.0
    for k in range(round((by - 6.8) * 200)):
        rig.step(*((HERE,) if k % 4 == 0 else ()))
        fastest = max(fastest, rig.speed)
    np.testing.assert_allclose(rig.position, (0.0, -metres, -20.0), atol=0.05)
    assert fastest < rig.config.max_speed
    assert rig.autopilot.mode is Mode.GUIDED
    np.testing.assert_allclose(rig.autopilot.estimate.position, (0.0, 0.0, -20.0), atol=0.05)
    rig.autopilot.shift_gps((0.0, 0.0, 0.0))
    rig.run(20.0, HERE)
    np.testing.assert_allclose(rig.position, (0.0, 0.0, -20.0), atol=5e-3)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_on_the_ground_without_gps_it_does_not_arm(flavour):
    rig = Rig(flavour)
    rig.run(1.1)
    rig.autopilot.lose_gps()
    rig.run(PATIENCE[flavour] + 0.1)
    assert rig.order(ARM, 1) == [1]
    rig.autopilot.regain_gps()
    rig.run(0.1)
    assert rig.order(ARM, 1) == [0]


def test_a_takeoff_survives_a_jump_of_its_frame():
    """It goes on straight up from where it is."""
    rig = Rig("ardupilot", takeoff_speed=0.5)
    rig.run(1.1)
    rig.guided()
    rig.order(ARM, 1)
    assert rig.order(22, 0, 0, 0, 0, 0, 0, 8.0) == [0]
    rig.autopilot.shift_gps((0.0, 10.0, 0.0))
    rig.run(25.0)
    np.testing.assert_allclose(rig.position, (0.0, 0.0, -8.0), atol=0.05)
    np.testing.assert_allclose(rig.autopilot.estimate.position, (10.0, 0.0, -8.0), atol=0.05)


@pytest.mark.parametrize("profile", ["rtk", "gnss"])
def test_faults_add_to_what_the_profile_does(profile):
    rig = hovering(sensors=profile)
    before = rig.autopilot.estimate_error
    rig.autopilot.shift_gps((0.0, 0.0, 3.0))
    rig.run(6.0, HERE)
    change = rig.autopilot.estimate_error - before
    np.testing.assert_allclose(change, (0.0, 0.0, -3.0), atol=0.4)
