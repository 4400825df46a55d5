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
