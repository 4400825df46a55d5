"""A whole autopilot on JSBSim flies as on our own physics."""

from __future__ import annotations

import numpy as np
import pytest

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandLong
from sitl.config.autopilot import AutopilotConfig
from sitl.environment.weather import WeatherConfig
from sitl.node import Autopilot
from tests.sitl.autopilot_rig import ARM, FIREFLY, FLAVOURS, LAND, PILOT, SITE, Rig, setpoint

pytest.importorskip("jsbsim", reason="there is no wheel of JSBSim for this machine")

GOALS = ((3.0, -2.0, -5.0), (3.0, 4.0, -7.0))


def flight(physics: str, flavour: str) -> tuple[np.ndarray, Rig]:
    """From the ground to two set-points and down again: positions (n, 3) (m, NED), 100 a second."""
    rig = Rig(flavour, tick=10_000, physics=physics)
    rig.hover(2.5)
    track = []
    for goal in GOALS:
        rig.step(setpoint(position=goal, yaw=0.7))
        rig.guided()
        for k in range(500):
            rig.step(*((setpoint(position=goal, yaw=0.7),) if k % 2 == 0 else ()))
            track.append(rig.position)
    rig.step(CommandLong(PILOT, 11, 1, LAND, 0, (0.0,) * 7))
    for _ in range(2500):
        rig.step()
        track.append(rig.position)
    return np.array(track), rig


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_it_follows_set_points_and_lands_as_on_our_own_physics(flavour):
    (own, own_rig), (jsbsim, rig) = flight("own", flavour), flight("jsbsim", flavour)
    for track in (own, jsbsim):
        for k, goal in enumerate(GOALS):
            np.testing.assert_allclose(track[500 * k + 499], goal, atol=0.05)
    assert np.linalg.norm(jsbsim - own, axis=1).max() < 0.02
    assert not rig.autopilot.airborne
    assert not rig.autopilot.armed
    assert rig.autopilot.mode == own_rig.autopilot.mode
    assert rig.texts == own_rig.texts
    np.testing.assert_allclose(jsbsim[-1, 2], own[-1, 2], atol=1e-3)


def test_on_the_ground_it_stays_there_until_it_takes_off():
    rig = Rig(physics="jsbsim")
    rig.run(3.0)
    start = rig.position
    rig.guided()
    assert rig.order(ARM, 1) == [0]
    rig.run(3.0)
    assert not rig.autopilot.airborne
    np.testing.assert_allclose(rig.position, start, atol=1e-3)


def test_the_same_flight_twice_is_the_same_bytes():
    rigs = [Rig(physics="jsbsim").hover(2.5) for _ in range(2)]
    assert rigs[0].bytes == rigs[1].bytes


def hovering(site: FleetFrame, latitude: float, longitude: float, **weather: object) -> Autopilot:
    config = AutopilotConfig(
        system_id=11,
        latitude=latitude,
        longitude=longitude,
        altitude=site.altitude,
        start_height=10.0,
        physics="jsbsim",
    )
    autopilot = Autopilot(config, FIREFLY, site, seed=1, weather=WeatherConfig(**weather))
    for now in range(0, 5_000_000, 10_000):
        autopilot.step(now, [])
    return autopilot


def test_who_starts_far_from_the_sites_origin_hovers_where_it_starts():
    there = SITE.to_geodetic((1500.0, -900.0, 0.0))
    autopilot = hovering(SITE, there[0], there[1])
    np.testing.assert_allclose(autopilot.state.position[:2], (-900.0, 1500.0), atol=0.02)
    assert autopilot.airborne


def test_the_wind_that_is_told_has_jsbsims_turbulence():
    blown = hovering(
        SITE,
        SITE.latitude,
        SITE.longitude,
        wind=(5.0, 0.0, 0.0),
        turbulence="light",
        turbulence_by="jsbsim",
    )
    gust = np.array(blown.wind) - (0.0, 5.0, 0.0)
    assert 0.05 < np.linalg.norm(gust) < 10.0
    np.testing.assert_allclose(blown.state.position, (0.0, 0.0, -10.0), atol=1.0)
