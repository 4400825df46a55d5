"""A destination that moves is followed where it is, and a push that lasts does not turn the vehicle round."""

from __future__ import annotations

import numpy as np
import pytest

from companion.avoidance.certified.commitment import Commitment
from companion.avoidance.certified.deadlock import DeadlockTurn, Pushes
from companion.avoidance.certified.detour import Subgoal
from companion.avoidance.certified.qp import Objective, SeparationQp
from companion.config.certified import CertifiedConfig
from companion.config.planning import LimitsConfig
from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS
from tests.companion.avoidance.certified.test_commitment import NOBODY

CONFIG = CertifiedConfig(dt_us=DT, epoch_us=DT)
LIMITS = LimitsConfig(u_max=(3.0, 3.0, 3.0), v_max=(7.0, 7.0, 7.0), box_max=(900.0, 900.0, 50.0))
HERE = np.array([0.0, 0.0, 5.0])
BACK = Pushes(np.array([[-1e3, 0.0, 0.0]]), np.zeros((1, 3)))


def lag(velocity: Array, seconds: float, *, moving: bool = True) -> float:
    """Fly after a destination with a ``velocity``, and say how far from it (m) the plan begins in the end."""
    program = SeparationQp(STEPS, LIMITS, CONFIG)
    kept = Commitment(CONFIG, program, DeadlockTurn(CONFIG.deadlock), 7)
    kept.begin(EPOCH, HERE)
    now, ahead = EPOCH, 1e-6 * DT * np.arange(1.0, STEPS + 1.0)
    for _ in range(round(1e6 * seconds / DT)):
        now += DT
        kept.turn(now)
        # The plan that is made now begins an epoch later.
        begins = 1e-6 * (now + DT - EPOCH)
        places = HERE + (begins + ahead)[:, None] * velocity
        wish = Objective(places, np.broadcast_to(velocity, places.shape), np.zeros_like(places), moving)
        assert kept.replan(wish, Subgoal(places[-1], 0.0), NOBODY)
    start = kept.following
    assert start is not None
    return float(np.linalg.norm(start.position_m - (HERE + 1e-6 * (start.epoch - EPOCH) * velocity)))


@pytest.mark.parametrize("speed", [0.5, 2.0, 4.0])
def test_a_destination_at_constant_speed_is_caught_up_with(speed: float) -> None:
    """Although every plan comes to rest. Weighed only where it comes to rest it stays metres behind."""
    velocity = speed * np.array([0.8, 0.6, 0.0])
    assert lag(velocity, 12.0) < 0.1
    assert lag(np.array([4.0, 0.0, 0.0]), 12.0, moving=False) > 5.0 * lag(np.array([4.0, 0.0, 0.0]), 12.0)


def turned(seconds: float, *, moving: bool) -> float:
    """How far (rad) the goal is turned after a push straight back for so long."""
    turn = DeadlockTurn(CONFIG.deadlock)
    for _ in range(round(5 * seconds)):
        turn.learn(HERE, HERE + np.array([4.0, 0, 0]), BACK, 1.0, 0.2, moving=moving)
    return turn.angle


def test_a_goal_that_moves_is_never_turned_back() -> None:
    """Its distance does not fall when it is followed well, so that is no lack of progress."""
    assert turned(20.0, moving=False) == pytest.approx(CONFIG.deadlock.bend_more)
    assert turned(20.0, moving=True) == pytest.approx(CONFIG.deadlock.bend)
