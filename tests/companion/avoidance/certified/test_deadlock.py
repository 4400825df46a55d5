"""Whom the deadlock turn leads aside, and with whom it does not race."""

from __future__ import annotations

import numpy as np
import pytest

from companion.avoidance.certified.deadlock import DeadlockTurn, Pushes
from companion.config.certified import DeadlockConfig

GOAL = np.array([8.0, 0.0, 5.0])
REST = np.array([0.0, 0.0, 5.0])
BACK = (-1e3, 0.0, 0.0)
AHEAD, RIGHT = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])


def turned(*velocities: np.ndarray, sense: float = 1.0) -> float:
    """How far (rad) the goal is turned after a second in which vehicles at these velocities push back."""
    turn = DeadlockTurn(DeadlockConfig(), sense)
    for _ in range(5):
        turn.learn(REST, GOAL, Pushes(np.array([BACK] * len(velocities)), np.array(velocities)), 1.0, 0.2)
    return turn.angle


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_nobody_turns_to_the_side_to_which_the_other_flies_ahead(sense: float) -> None:
    side = sense * RIGHT
    assert turned(2.0 * AHEAD + 2.0 * side, sense=sense) == 0.0
    # At rest, head on, across, back across, and ahead to the other side.
    for velocity in (0.0 * side, -3.0 * AHEAD, 3.0 * side, 3.0 * side - AHEAD, 2.0 * AHEAD - 2.0 * side):
        assert turned(velocity, sense=sense) == pytest.approx(0.8)


def test_the_others_that_push_count_all_the_same() -> None:
    assert turned(2.0 * (AHEAD + RIGHT), np.zeros(3)) == turned(np.zeros(3))


def stands(step: np.ndarray, *, goal: np.ndarray = GOAL, moving: bool = False, seconds: float = 3.0) -> bool:
    """Whether a plan whose end moves by ``step`` in each second stands after some seconds."""
    turn = DeadlockTurn(DeadlockConfig())
    nobody = Pushes(np.empty((0, 3)), np.empty((0, 3)))
    for k in range(round(5 * seconds) + 1):
        turn.learn(REST + 0.2 * k * step, goal, nobody, 1.0, 0.2, moving=moving)
    return turn.stands


def test_a_plan_stands_whose_end_stays_about_one_place_that_is_not_the_goal() -> None:
    still = np.zeros(3)
    assert stands(still)
    assert stands(still, seconds=1.0)
    assert not stands(still, seconds=0.8)
    # Progress of some centimetres in a second counts as none, and aside counts as on.
    assert stands(0.08 * AHEAD)
    assert not stands(0.5 * AHEAD)
    assert not stands(0.5 * RIGHT)
    assert not stands(still, goal=REST)
    assert not stands(still, moving=True)
