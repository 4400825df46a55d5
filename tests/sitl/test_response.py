"""The laws of a firmware's response: linear, the same everywhere, and in the end where it is told to be."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from autopilot_rig import FLAVOURS, ZERO, Rig
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from sitl.flavours import Mode
from sitl.response import RESPONSES, Motion, Response, Stage

DT = 0.01
Array = NDArray[np.float64]
Stages = tuple[Stage, ...]
VECTORS = st.tuples(*[st.floats(-10.0, 10.0)] * 3)
FIRMWARE = pytest.mark.parametrize("stages", RESPONSES.values(), ids=RESPONSES)


def motion(position: ArrayLike, velocity: ArrayLike = ZERO, acceleration: ArrayLike = ZERO) -> Motion:
    north, east, down = np.transpose((position, velocity, acceleration)).tolist()
    return tuple(zip(north, east, down, strict=True))  # type: ignore[return-value]


def circle(t: float, radius: float = 5.0, speed: float = 3.0) -> Motion:
    w = speed / radius
    c, s = math.cos(w * t), math.sin(w * t)
    return motion(
        (radius * c, radius * s, -3.0),
        (-speed * s, speed * c, 0.0),
        (-w * speed * c, -w * speed * s, 0.0),
    )


def led(stages: Stages, path: Callable[[float], Motion], seconds: float, dt: float = DT) -> Array:
    """Positions (n, 3) while it goes after a path from the path's beginning, at the path's speed."""
    response = Response(stages)
    response.relocate(*path(0.0)[:2])
    found = []
    for k in range(round(seconds / dt)):
        response.advance(path((k + 1) * dt), dt)
        found.append(response.motion[0])
    return np.array(found)


@FIRMWARE
@settings(max_examples=20)
@given(VECTORS, VECTORS)
def test_it_comes_to_rest_where_it_is_told_to(stages: Stages, begin: tuple, goal: tuple) -> None:
    response = Response(stages)
    response.restart(begin)
    for _ in range(3000):
        response.advance(motion(goal), 0.02)
    position, velocity, acceleration = map(np.array, response.motion)
    assert np.abs(position - goal).max() < 1e-3
    assert np.abs(velocity).max() < 1e-3
    assert np.abs(acceleration).max() < 1e-3


@FIRMWARE
def test_drag_is_learnt_on_a_straight(stages: Stages) -> None:
    """With its integral it flies a constant velocity without lagging in the end, against all drag."""
    velocity = np.array((3.0, -2.0, 0.5))
    path = led(stages, lambda t: motion(velocity * t, velocity), 60.0)
    assert np.linalg.norm(path[100] - velocity * 1.01) > 0.1
    assert np.linalg.norm(path[-1] - velocity * 60.0) < 1e-3


@FIRMWARE
def test_superposition(stages: Stages) -> None:
    twice = led(stages, lambda t: motion(*(2.0 * np.array(part) for part in circle(t))), 10.0)
    np.testing.assert_allclose(twice, 2.0 * led(stages, circle, 10.0), atol=1e-9)


@FIRMWARE
def test_it_is_the_same_everywhere_and_in_every_direction(stages: Stages) -> None:
    away = np.array((100.0, -50.0, 7.0))
    turn = np.array(((0.6, 0.8, 0.0), (-0.8, 0.6, 0.0), (0.0, 0.0, 1.0)))

    def elsewhere(t: float) -> Motion:
        position, velocity, acceleration = (turn @ part for part in circle(t))
        return motion(position + away, velocity, acceleration)

    there = led(stages, elsewhere, 10.0)
    np.testing.assert_allclose(there, led(stages, circle, 10.0) @ turn.T + away, atol=1e-9)


@FIRMWARE
def test_the_length_of_steps_hardly_matters(stages: Stages) -> None:
    coarse, fine = led(stages, circle, 10.0), led(stages, circle, 10.0, DT / 4.0)
    assert np.abs(coarse - fine[3::4]).max() < 0.03


def test_a_chase_lets_what_agrees_with_itself_through() -> None:
    """ArduPilot's first stage: a trajectory with its acceleration is unchanged; without, it is cut."""
    chase = RESPONSES["ardupilot"][:1]
    wanted = np.array([circle((k + 1) * DT)[0] for k in range(1000)])
    assert np.abs(led(chase, circle, 10.0) - wanted).max() < 5e-3
    cut = led(chase, lambda t: (*circle(t)[:2], ZERO), 10.0)
    assert np.linalg.norm(cut[-1] - wanted[-1]) > 0.3


@FIRMWARE
def test_a_frame_that_slips_takes_it_along(stages: Stages) -> None:
    response = Response(stages)
    response.restart((1.0, 2.0, -3.0))
    response.relocate((4.0, 5.0, -6.0), (1.0, 0.0, 0.0))
    assert response.motion[:2] == ((4.0, 5.0, -6.0), (1.0, 0.0, 0.0))


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_vehicle_with_it_takes_off_and_lands(flavour: str) -> None:
    rig = Rig(flavour, response="firmware").hover(5.0)
    assert -rig.autopilot.estimate.pose.position[2] == pytest.approx(5.0, abs=0.15)
    assert rig.autopilot.mode is (Mode.GUIDED if flavour == "ardupilot" else Mode.HOLD)
    assert rig.order(21) == [0]
    rig.run(15.0)
    assert not rig.autopilot.armed
    assert not rig.autopilot.airborne
