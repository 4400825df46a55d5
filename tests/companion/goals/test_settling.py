"""Settling: from what a vehicle keeps how far before it lands."""

from __future__ import annotations

import numpy as np
import pytest

from companion.config import CompanionConfig
from companion.config.obstacles import Box
from companion.goals.settling import Settling, beside_column, between_columns
from companion.obstacles import proximity, static, traffic
from companion.obstacles.static import FixedObstacles
from companion.values.horizon import Motion
from companion.values.obstacles import Obstacles
from companion.world import World
from mavlink_bridge.frames import FleetFrame

HERE = Motion(np.array([0.0, 0.0, 5.0]), np.zeros(3), np.zeros(3))
VEHICLE, TARGET, SIZE = 12, 1, 0.4
CERTIFIED = CompanionConfig.model_validate({"avoidance": "certified", "field": {"position_sigma": 0.6}})


def near(config: CompanionConfig, system: int, beyond: float) -> bool:
    """Whether an obstacle is in the way whose surface is ``beyond`` m away, high above the vehicle."""
    place = np.array([SIZE + beyond, 0.0, 25.0])
    distances = np.array([1.0])
    positions = np.broadcast_to(place, (1, config.horizon.steps + 1, 3))
    settling = Settling(config, {TARGET})
    settling.rest(0, HERE, Obstacles((system,), positions, distances, distances, np.array([SIZE])))
    return not settling.clear


@pytest.mark.parametrize("system", [VEHICLE, TARGET, static.FIRST_ID, proximity.FIRST_ID, traffic.FIRST_ID])
def test_what_flies_no_committed_plan_needs_the_room_of_one_column(system: int) -> None:
    """A vehicle that may have a column of its own needs that of two; the field keeps its one clearance."""
    two = between_columns(CERTIFIED) if system == VEHICLE else beside_column(CERTIFIED)
    clearance = CERTIFIED.guard.landing_clearance
    assert clearance < beside_column(CERTIFIED) < between_columns(CERTIFIED)
    for config, least in ((CompanionConfig(), clearance), (CERTIFIED, two)):
        assert near(config, system, least - 1e-6)
        assert not near(config, system, least + 1e-6)


def test_who_moves_aside_does_so_from_what_is_in_the_way() -> None:
    """A post may be nearer than a vehicle and yet far enough."""
    distances, steps = np.ones(2), CERTIFIED.horizon.steps + 1
    places = np.array([[3.2, 0.0, 5.0], [0.0, -4.0, 5.0]])
    obstacles = Obstacles(
        (static.FIRST_ID, VEHICLE), np.repeat(places[:, None], steps, 1), distances, distances
    )
    settling = Settling(CERTIFIED)
    place = settling.rest(0, HERE, obstacles)
    assert not settling.clear
    assert place[1] > between_columns(CERTIFIED) - 4.0
    assert place[0] == 0.0


@pytest.mark.parametrize("config", [CompanionConfig(), CERTIFIED], ids=["field", "certified"])
def test_nobody_lands_on_a_box_however_far_below_it_is(config: CompanionConfig) -> None:
    """Above a roof, or below a plate that hangs, a vehicle moves aside until it is clear of it."""
    roof = Box(kind="box", at=(0.5, -1.0, 2.0), size=(6.0, 30.0, 4.0), yaw_deg=10.0)
    plate = Box(kind="box", at=(0.5, -1.0, 100.0), size=(6.0, 30.0, 0.1), yaw_deg=10.0)
    for box in (roof, plate):
        config = config.model_copy(update={"obstacles": (box,)})
        picture = World(config, 11, 1, FleetFrame(47.4, 8.5, 488.0))
        settling, here = Settling(config), np.array([0.0, 0.0, 60.0])
        for _ in range(30):
            prediction = np.broadcast_to(here, (config.horizon.steps + 1, 3))
            near_by = picture.obstacles(1, picture.at(1), prediction)
            here = settling.rest(1, Motion(here, np.zeros(3), np.zeros(3)), near_by)
            if settling.clear:
                break
        assert settling.clear
        beside = here * (1.0, 1.0, 0.0) + (0.0, 0.0, box.at[2])
        assert FixedObstacles([box]).distance(beside)[0] >= config.guard.landing_clearance


def test_columns_keep_a_larger_distance_of_obstacles_and_no_smaller_one_than_of_others() -> None:
    def least(d_min_obstacle: float | None) -> float:
        certified = CERTIFIED.certified.model_copy(update={"d_min_obstacle": d_min_obstacle})
        return beside_column(CERTIFIED.model_copy(update={"certified": certified}))

    d_min = CERTIFIED.field.d_min
    assert least(0.5 * d_min) == least(None)
    assert least(d_min + 1.0) == pytest.approx(least(None) + 1.0)
