"""Laws of flight among boxes in a loop: walls are not passed through; boxes are passed, also over and under.

The vehicle is a point that follows its plans exactly.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.config.obstacles import Obstacle
from companion.obstacles.static import FixedObstacles
from outrider import Box, Planner, PlannerConfig, Wall

LIMITS = {"box_min": (-30.0, -30.0, 1.0), "box_max": (30.0, 30.0, 12.0)}
FIELD = PlannerConfig(limits=LIMITS, field={"d_min": 1.0}, rates={"replan_us": 40_000})
CERTIFIED = PlannerConfig(avoidance="certified", limits=LIMITS, field={"d_min": 1.0})
DT = 0.04
BOTH = pytest.mark.parametrize("config", [FIELD, CERTIFIED], ids=["field", "certified"])


def flown(
    config: PlannerConfig,
    obstacles: list[Obstacle],
    start: tuple[float, float, float],
    goal: NDArray[np.float64],
    speed: float = 0.0,
    turns: int = 400,
) -> tuple[NDArray[np.float64], float]:
    """The places (n, 3), m, of a flight from ``start``, and its least distance (m) from the obstacles."""
    planner = Planner(config.model_copy(update={"obstacles": tuple(obstacles)}))
    x = np.array(start)
    v = speed * (goal - x) / np.linalg.norm(goal - x)
    places = [x]
    for turn in range(turns):
        step = planner.step(1.7e9 + DT * turn, x, v, goal=goal)
        if step.plan is not None:
            x, v, _ = step.plan.at(1.7e9 + DT * (turn + 1))
        places.append(x)
        if np.linalg.norm(x - goal) < 0.3:
            break
    found = np.array(places)
    return found, float(FixedObstacles(obstacles).distance(found).min())


@BOTH
@pytest.mark.parametrize("sense", ["own", "right"])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0])
@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_a_thin_wall_across_the_room_is_not_passed(
    config: PlannerConfig, sense: str, degrees: float, speed: float
) -> None:
    """The goal is behind it, and the wall thinner than what a vehicle flies between two steps of a plan."""
    wall = Wall(kind="wall", ends=((5.0, -29.0), (5.0, 29.0)), thickness=0.1)
    towards = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
    start = (-2.0, -8.0 * float(towards[1]), 5.0)
    sensed = config.model_copy(update={"turning_sense": sense})
    places, least = flown(sensed, [wall], start, start + 16.0 * towards, speed, 220)
    assert least > config.field.d_min
    assert places[:, 0].max() > 2.5
    assert places[:, 0].max() < 5.0


@BOTH
@pytest.mark.parametrize("aside", [-0.3, 0.1, 0.6])
def test_a_turned_box_and_the_end_of_a_wall_are_passed(config: PlannerConfig, aside: float) -> None:
    obstacles: list[Obstacle] = [
        Box(kind="box", at=(4.0, 0.0, 5.0), size=(2.0, 2.0, 10.0), yaw_deg=20.0),
        Wall(kind="wall", ends=((10.0, 1.5), (10.0, 8.0))),
    ]
    goal = np.array([15.0, aside, 5.0])
    places, least = flown(config, obstacles, (-3.0, aside, 5.0), goal)
    assert np.linalg.norm(places[-1] - goal) < 0.3
    assert config.field.d_min < least < 2.5


@BOTH
@pytest.mark.parametrize(("height", "side"), [(7.4, -1.0), (2.6, 1.0)], ids=["under", "over"])
def test_a_beam_across_the_room_is_passed_under_or_over(
    config: PlannerConfig, height: float, side: float
) -> None:
    """Unlike a post a box ends above and below."""
    beam = Box(kind="box", at=(4.0, 0.0, height), size=(2.0, 50.0, 2.0))
    goal = np.array([12.0, 0.0, 5.0])
    places, least = flown(config, [beam], (-3.0, 0.0, 5.0), goal)
    assert np.linalg.norm(places[-1] - goal) < 0.3
    assert config.field.d_min < least < 3.0
    beside = places[np.abs(places[:, 0] - 4.0) < 1.0]
    assert len(beside)
    assert (side * (beside[:, 2] - height) > 1.0 + config.field.d_min).all()
