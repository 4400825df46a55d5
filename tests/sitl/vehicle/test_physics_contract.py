"""What holds of every physics, for every vehicle that is shipped."""

from __future__ import annotations

import numpy as np
import pytest

from sitl.backends.physics import Physics
from sitl.backends.selection import Start, physics
from sitl.environment.weather import WeatherConfig
from sitl.vehicle.multirotor import NotFiniteError, Reference
from tests.sitl.jsbsim_pairs import SITE, VEHICLES, vehicle

PLACE = np.array((2.0, -1.0, -4.0))
GROUND = 0.5

pytestmark = [
    pytest.mark.parametrize("name", VEHICLES),
    pytest.mark.parametrize("kind", ["own", "jsbsim"]),
]


def made(kind: str, name: str, *, hovering: bool) -> Physics:
    if kind == "jsbsim":
        pytest.importorskip("jsbsim", reason="there is no wheel of JSBSim for this machine")
    start = Start(PLACE if hovering else PLACE * (1.0, 1.0, 0.0) + (0.0, 0.0, GROUND), 0.4, GROUND, hovering)
    return physics(kind, vehicle(name, 2_500), start, SITE, WeatherConfig(), 1, 11)


def test_who_starts_in_the_air_hovers_there_at_once(kind, name):
    flown = made(kind, name, hovering=True)
    track = flown.advance(800, Reference.hover(PLACE, 0.4))
    assert track.shape == (800, 3)
    assert np.linalg.norm(track - PLACE, axis=1).max() < 2e-3
    np.testing.assert_array_equal(track[-1], flown.state.position)
    assert not flown.on_ground


def test_who_starts_on_the_ground_stands_flies_and_lands(kind, name):
    flown = made(kind, name, hovering=False)
    rest = (PLACE[0], PLACE[1], GROUND - flown.config.rest_height)
    flown.advance(200, None, idle=True)
    assert flown.on_ground
    np.testing.assert_allclose(flown.state.position, rest, atol=1e-3)
    flown.advance(3000, Reference.hover(PLACE, 0.4))
    assert not flown.on_ground
    np.testing.assert_allclose(flown.state.position, PLACE, atol=0.02)
    flown.advance(2000, Reference(PLACE, np.array((0.0, 0.0, 1.0)), yaw=0.4))
    flown.advance(400, None)
    assert flown.on_ground
    np.testing.assert_allclose(flown.state.position[:2], rest[:2], atol=0.05)
    np.testing.assert_allclose(flown.state.position[2], rest[2], atol=1e-3)


def test_the_air_is_told_and_blows(kind, name):
    flown = made(kind, name, hovering=True)
    flown.advance(40, Reference.hover(PLACE, 0.4), (4.0, -3.0, 0.5))
    assert flown.air == pytest.approx((4.0, -3.0, 0.5))
    assert flown.state.position[0] > PLACE[0]
    assert flown.state.position[1] < PLACE[1]


def test_the_state_is_an_own_copy(kind, name):
    flown = made(kind, name, hovering=True)
    for value in flown.state:
        value += 1.0
    assert np.linalg.norm(flown.advance(8, Reference.hover(PLACE, 0.4)) - PLACE, axis=1).max() < 1e-3


def test_a_failed_rotor_turns_at_its_part(kind, name):
    flown = made(kind, name, hovering=False)
    flown.fail_rotor(2, 0.25)
    flown.advance(400, None, idle=True)
    idle = flown.config.omega_idle * np.where(np.arange(len(flown.config.rotors)) == 2, 0.25, 1.0)
    np.testing.assert_allclose(flown.state.rotor_speeds, idle, rtol=1e-9)
    for index, left, error in ((9, 0.5, IndexError), (0, float("nan"), ValueError)):
        with pytest.raises(error, match=name):
            flown.fail_rotor(index, left)


def test_what_is_not_finite_moves_nothing(kind, name):
    flown = made(kind, name, hovering=True)
    with pytest.raises(NotFiniteError):
        flown.advance(2, Reference.hover(PLACE * np.nan))
    np.testing.assert_array_equal(flown.state.position, PLACE)
