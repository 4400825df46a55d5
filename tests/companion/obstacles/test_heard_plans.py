"""A shared plan counts like a position if nothing else is heard, and if its sender can be there."""

from __future__ import annotations

import numpy as np
import pytest

from companion.config import CompanionConfig
from companion.telemetry.sharing import plan_message, position_message
from companion.values.horizon import roll_out
from companion.values.speed_bounds import SpeedBounds
from companion.world import World
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Source
from tests.companion.rig import ZERO

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
NOW, SECOND, OWN, OTHER = 1_767_225_600_000_000, 1_000_000, 11, 12
CONFIG = CompanionConfig.model_validate({"task": "goto", "guard": {"unheard_us": 300_000}})
THERE = np.array([6.0, 0.0, 0.0])


def bounds(plan_at: np.ndarray | None, config: CompanionConfig = CONFIG) -> SpeedBounds | None:
    """After two seconds of silence, in which only a plan that begins at ``plan_at`` came, late.

    The neighbour hovered ``THERE`` before.
    """
    world, source, steps = World(config, OWN, 1, FLEET), Source(OTHER, 195), config.horizon.steps + 1
    delay = config.neighbour.delay_us
    for now in range(NOW, NOW + SECOND, 100_000):
        world.receive(now + delay, "swarm", position_message(source, now - NOW + 1, FLEET, THERE, ZERO, None))
    neighbours = world.neighbours
    # The places are asked for all the time, as in flight.
    for now in range(NOW + SECOND, NOW + 3 * SECOND, 50_000):
        neighbours.bounds(now, ZERO)
        if plan_at is not None and now == NOW + 3 * SECOND - 100_000:
            horizon = roll_out(now, config.horizon.dt_us, plan_at, ZERO, np.zeros((steps, 3)))
            world.receive(now, "swarm", plan_message(horizon, source, FLEET))
    return neighbours.bounds(NOW + 3 * SECOND, ZERO)


def test_a_plan_says_where_its_sender_is() -> None:
    silent, told = bounds(None), bounds(THERE + np.array([1.0, 0.0, 0.0]))
    assert silent is not None
    assert told is not None
    # 7 m, less d_min, the error of a plan, and what one may come in 0.1 s.
    assert told.gaps[0] == pytest.approx(7.0 - CONFIG.field.d_min - 0.3 - 0.35, abs=0.15)
    assert silent.gaps[0] < 2.0
    np.testing.assert_allclose(told.normals, [[1.0, 0.0, 0.0]], atol=1e-3)


def test_a_plan_where_its_sender_cannot_be_says_nothing() -> None:
    silent, told = bounds(None), bounds(THERE + np.array([60.0, 0.0, 0.0]))
    assert silent is not None
    assert told is not None
    assert told.gaps[0] == silent.gaps[0]


def test_without_the_setting_nothing_is_bounded() -> None:
    assert bounds(THERE, CompanionConfig()) is None
