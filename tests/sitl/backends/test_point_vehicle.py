"""A point is where its reference says; averaged over a window, steps of acceleration bound its jerk."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.frames import FleetFrame
from outrider.resources import find
from outrider.yaml_files.yaml_file import load
from sitl.backends.physics import Physics
from sitl.backends.selection import Start, physics
from sitl.environment.weather import WeatherConfig
from sitl.values.attitudes import euler, to_body
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.ground import GRAVITY
from sitl.vehicle.multirotor import NotFiniteError, Reference

POINT, JERK = (load(find("vehicles", name), VehicleConfig) for name in ("point", "point-jerk"))
STEP = 1e-6 * POINT.physics_period
KNOT = 1e-6 * JERK.point_window_us
SITE = FleetFrame(47.0, 8.0, 500.0)


def made(config: VehicleConfig, *, height: float = 10.0, hovering: bool = True) -> Physics:
    """Return a point over the ground at z = 0."""
    start = Start(np.array((0.0, 0.0, -height)), 0.3, 0.0, hovering)
    return physics("own", config, start, SITE, WeatherConfig(), seed=1, system_id=1)


def flown(vehicle: Physics, knots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fly accelerations (n, 3), each for a knot; return times, wanted and true (position, acceleration)."""
    position, velocity = vehicle.state.position, np.zeros(3)
    wanted, true = [], []
    for a in knots:
        for _ in range(round(KNOT / STEP)):
            vehicle.advance(1, Reference(position, velocity, a))
            position, velocity = position + STEP * velocity + 0.5 * STEP**2 * a, velocity + STEP * a
            wanted.append((position, a))
            true.append((vehicle.state.position, vehicle.state.acceleration))
    return STEP * np.arange(1, len(true) + 1), np.array(wanted), np.array(true)


def braking(random: np.random.Generator, count: int) -> np.ndarray:
    """Return random accelerations (n, 3) that end at rest."""
    a = random.uniform(-20.0, 20.0, size=(count, 3))
    a[-1] = -a[:-1].sum(axis=0)
    return a


def test_a_point_is_exactly_where_its_reference_is() -> None:
    knots = braking(np.random.default_rng(1), 6)
    _, wanted, true = flown(made(POINT, height=100.0), knots)
    assert np.abs(true[:, 0] - wanted[:, 0]).max() < 1e-9
    assert np.array_equal(true[:, 1], wanted[:, 1])


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
def test_the_jerk_of_an_averaged_point_is_bounded_by_the_steps_of_acceleration(seed: int) -> None:
    knots = np.vstack([braking(np.random.default_rng(seed), 5), np.zeros((2, 3))])
    _, wanted, true = flown(made(JERK, height=100.0), knots)
    jerk = np.diff(true[:, 1], axis=0) / STEP
    steps = np.abs(np.diff(np.vstack([np.zeros((1, 3)), knots]), axis=0)).max(axis=0)
    assert (np.abs(jerk) <= steps / KNOT + 1e-6).all()
    # It ends where the reference ends, and is the reference half a window ago, but for ‖a‖ W²/24.
    late = round(0.5 * KNOT / STEP)
    off = np.abs(true[late:, 0] - wanted[:-late, 0]).max(axis=0)
    assert (off <= np.abs(knots).max(axis=0) * KNOT**2 / 24.0 * 1.02 + 1e-9).all()
    assert np.abs(true[-1, 0] - wanted[-1, 0]).max() < 1e-6


def test_the_attitude_is_that_of_a_thrust_that_gives_the_acceleration() -> None:
    vehicle = made(POINT)
    a = np.array((6.0, -3.0, 1.0))
    vehicle.advance(4, Reference(vehicle.state.position, acceleration=a, yaw=0.7))
    attitude = tuple(vehicle.state.attitude.tolist())
    force = to_body(attitude, tuple((a - (0.0, 0.0, GRAVITY)).tolist()))
    assert force[:2] == pytest.approx((0.0, 0.0), abs=1e-9)
    assert force[2] < 0.0
    assert euler(attitude)[2] == pytest.approx(0.7)


def test_a_point_without_a_reference_falls_and_stays_on_the_ground() -> None:
    vehicle = made(POINT, height=5.0)
    vehicle.advance(400, None)
    assert not vehicle.on_ground
    assert vehicle.state.position[2] == pytest.approx(-5.0 + 0.5 * GRAVITY, abs=0.02)
    vehicle.advance(400, None)
    assert vehicle.on_ground
    assert vehicle.state.position[2] == -POINT.rest_height
    assert not vehicle.state.velocity.any()
    # A reference below the ground does not move it, one above it lifts it.
    vehicle.advance(4, Reference.hover((0.0, 0.0, 1.0)))
    assert vehicle.on_ground
    vehicle.advance(4, Reference.hover((0.0, 0.0, -2.0)))
    assert not vehicle.on_ground


def test_a_point_refuses_what_it_has_not() -> None:
    vehicle = made(POINT)
    with pytest.raises(ValueError, match="a point has no rotors"):
        vehicle.fail_rotor(0, 0.0)
    with pytest.raises(NotFiniteError):
        vehicle.advance(1, Reference.hover((np.nan, 0.0, 0.0)))
    start = Start(np.zeros(3), 0.0, 0.0, hovering=True)
    with pytest.raises(ValueError, match="cannot hover"):
        physics("own", POINT, start, SITE, WeatherConfig(), seed=1, system_id=1)
    with pytest.raises(ValueError, match="needs physics: own"):
        physics("jsbsim", POINT, start, SITE, WeatherConfig(), seed=1, system_id=1)
    with pytest.raises(ValueError, match="needs motion: point"):
        VehicleConfig.model_validate({**POINT.model_dump(), "motion": "multirotor", "point_window_us": 2500})
