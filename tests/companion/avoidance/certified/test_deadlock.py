"""Whom the deadlock turn leads aside, and with whom it does not race."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from companion.avoidance.certified.deadlock import DeadlockTurn, Pushes
from companion.config.certified import DeadlockConfig
from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

GOAL = np.array([8.0, 0.0, 5.0])
REST = np.array([0.0, 0.0, 5.0])
BACK = (-1e3, 0.0, 0.0)
AHEAD, RIGHT = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])
NOBODY = Pushes(np.empty((0, 3)), np.empty((0, 3)))


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
    for k in range(round(5 * seconds) + 1):
        turn.learn(REST + 0.2 * k * step, goal, NOBODY, 1.0, 0.2, moving=moving)
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


def test_a_second_goal_is_measured_from_where_it_was_given() -> None:
    """A vehicle that has been at its first goal was never nearer to the second one than to that."""
    turn, rest = DeadlockTurn(DeadlockConfig()), REST
    for goal in (REST, GOAL):
        for _ in range(25):
            turn.measure_to(goal)
            rest = rest + 0.05 * (goal - rest)
            turn.learn(rest, goal, NOBODY, 1.0, 0.2)
            assert not turn.overtime


def stalled(goals: Sequence[Array | None], pushes: Pushes = NOBODY) -> DeadlockTurn:
    """The turn of a vehicle that stays for 8 s while it gets these goals in turn; None: on a surface."""
    turn = DeadlockTurn(DeadlockConfig())
    for k in range(40):
        goal = goals[k % len(goals)]
        turn.measure_to(goal)
        turn.learn(REST, GOAL if goal is None else goal, pushes, 1.0, 0.2)
    return turn


def test_who_is_stalled_is_not_on_the_way_to_another_goal() -> None:
    turn = stalled([GOAL], Pushes(np.array([BACK]), np.zeros((1, 3))))
    assert turn.stalled
    assert turn.angle > 3.0
    turn.measure_to(GOAL + 2.0 * RIGHT)
    assert not turn.overtime
    assert turn.angle == 0.0


def test_after_a_surface_the_same_destination_is_another_one() -> None:
    turn = stalled([GOAL])
    turn.measure_to(None)
    turn.measure_to(GOAL)
    assert not turn.overtime


@pytest.mark.parametrize("second", [GOAL + 3.0 * RIGHT, GOAL - 3.0 * AHEAD])
def test_goals_in_turn_are_no_progress(second: Array) -> None:
    assert stalled([GOAL, second]).stalled


def test_a_destination_that_slides_with_a_vehicle_is_no_progress() -> None:
    """With a speed limit it stays 4 m ahead, on a circle that leads nowhere."""
    turn = DeadlockTurn(DeadlockConfig())
    for k in range(40):
        place = REST + 3.0 * np.array([np.cos(0.1 * k), np.sin(0.1 * k), 0.0])
        turn.measure_to(place + 4.0 * AHEAD)
        turn.learn(place, place + 4.0 * AHEAD, NOBODY, 1.0, 0.2)
    assert turn.stalled


@pytest.mark.parametrize("planar", [True, False])
def test_a_vehicle_on_the_way_to_its_second_goal_is_not_overtime(planar: bool) -> None:
    """It is at its first goal for 3 s, and then needs 8 s for 20 m, with nobody in its way."""
    first, second = np.array([0.0, 0.0, 5.0]), np.array([20.0, 0.0, 5.0])
    swarm = Swarm(first[None], Rough(), [Habits()], 1, planar=planar, v_max=(3.0, 3.0, 2.0))
    turn = swarm.vehicles[0].flight._deadlock_turn
    overtime: list[bool] = []

    def goals(since: int, _system: int) -> Array:
        overtime.append(turn.overtime)
        return first if since < 3_000_000 else second

    swarm.run(12_000_000, goals)
    assert np.abs(swarm.vehicles[0]._flown(EPOCH + 12_000_000).position - second).max() < 0.1
    assert not any(overtime)
