"""Where a plan should end, among detours that begin and end: progress."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from companion.avoidance.certified.committed import resting as at_rest
from companion.avoidance.certified.deadlock import DeadlockTurn, Pushes
from companion.avoidance.certified.fixed_surfaces import FixedSurfaces
from companion.avoidance.certified.plan_goals import PlanGoals
from companion.avoidance.certified.told_goals import ToldGoals
from companion.avoidance.certified.way_obstacles import WayObstacles
from companion.config import CompanionConfig
from companion.config.certified import DeadlockConfig
from mavlink_bridge.messages import Source
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS

WALL = np.array([-4.2, -0.8, 0.0, 0.8, 4.2])
"""Places across the way, in least distances of plans: two gaps between them."""
BY_TURNS = 6
"""Number of plans for which one of the gaps is closed, then the other one."""


def test_a_way_through_gaps_that_open_and_close_is_no_progress() -> None:
    """With each new way at the same place progress began anew, so the vehicle never counted as stalled."""
    limits = {"box_min": (-6.0, -4.7, 0.5), "box_max": (6.0, 4.7, 2.0), "v_max": (1.0, 1.0, 0.5)}
    config = CompanionConfig.model_validate({"avoidance": "certified", "limits": limits})
    plans, obstacles = 0, WayObstacles(config, FixedSurfaces(config))
    d = obstacles.between

    def resting(_since: int, _still: float) -> dict[int, Any]:
        shut = -2.5 if (plans // BY_TURNS) % 2 else 2.5
        return {k: np.array([0.0, d * y, 1.2]) for k, y in enumerate([*WALL, shut], 20)}

    peers = SimpleNamespace(left={}, columns=(), resting=resting, ends=lambda: resting(0, 0.0))
    agreements: Any = SimpleNamespace(peers=peers)
    turn = DeadlockTurn(DeadlockConfig(), 1.0)
    goals = PlanGoals(config, Source(1, 1), agreements, obstacles, ToldGoals(Source(1, 1), 7), turn, 1.0)
    goals.prepare(1.2)
    rest, goal = np.array([-2.7 * d, 0.0, 1.2]), np.array([2.7 * d, 0.0, 1.2])
    own, start = np.tile(rest, (STEPS, 3, 1)), at_rest(EPOCH, DT, STEPS, rest, 7)
    against = Pushes(np.array([[-50.0, 0.0, 0.0]]), np.zeros((1, 3)))
    stalled, sides = 0, set()
    for plans in range(200):
        now = EPOCH + 200_000 * plans
        subgoal, _ = goals.chosen(now, now, start, own, goal, given=True, moving=False)
        turn.learn(rest, subgoal.place, against, 1.0, 0.2, subgoal.beyond)
        stalled += turn.stalled
        sides.add(float(np.sign(np.round(subgoal.place[1] - goal[1], 3))))
    # There were ways through both gaps.
    assert sides >= {-1.0, 1.0}
    assert stalled > 3


def least_angle(blocking: dict[int, Any], *, planar: bool) -> float:
    """The least angle (rad) of the turn from 5 to 20 s, of a vehicle whose plan is always pushed back.

    ``blocking``: vehicles that rest, at their places (3,), m; its goal is 9 m to the east of the origin.
    """
    config = CompanionConfig.model_validate({"avoidance": "certified", "planar": planar})
    obstacles = WayObstacles(config, FixedSurfaces(config))
    peers = SimpleNamespace(
        left={}, columns=(), newest=dict, resting=lambda *_: blocking, ends=lambda: blocking
    )
    agreements: Any = SimpleNamespace(peers=peers, age=lambda *_: 0.0)
    turn = DeadlockTurn(DeadlockConfig(), 1.0)
    goals = PlanGoals(config, Source(1, 1), agreements, obstacles, ToldGoals(Source(1, 1), 7), turn, 1.0)
    goals.prepare(5.0)
    rest, goal = np.array([0.0, 0.0, 5.0]), np.array([9.0, 0.0, 5.0])
    own, start = np.tile(rest, (STEPS, 3, 1)), at_rest(EPOCH, DT, STEPS, rest, 7)
    angles = []
    for plans in range(100):
        now = EPOCH + 200_000 * plans
        subgoal, aim = goals.chosen(now, now, start, own, goal, given=True, moving=False)
        angles.append(turn.angle)
        push = -50.0 * (aim - rest) / np.linalg.norm(aim - rest)
        turn.learn(rest, subgoal.place, Pushes(push[None], np.zeros((1, 3))), 1.0, 0.2)
    return min(angles[25:])


@pytest.mark.parametrize("planar", [True, False])
def test_a_turn_in_vain_ends_where_the_line_to_the_goal_is_free(planar: bool) -> None:
    assert least_angle({}, planar=planar) == 0.0
    assert least_angle({20: np.array([-3.0, 0.0, 5.0])}, planar=planar) == 0.0
    assert least_angle({20: np.array([4.0, 0.0, 5.0])}, planar=planar) > 0.5
