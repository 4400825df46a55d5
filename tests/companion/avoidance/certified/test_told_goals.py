"""Goals that vehicles tell each other."""

from __future__ import annotations

import numpy as np
import pytest

from companion.avoidance.certified.told_goals import ToldGoals
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.messages import Source, Tunnel

ORIGIN = 7
GOAL = np.array([3.0, -4.0, 5.0])


def told(*, origin: int = ORIGIN, reached: bool = False) -> bytes:
    sender = ToldGoals(Source(11, 1), origin)
    sender.tell(GOAL, reached=reached)
    (message,) = sender.messages()
    assert isinstance(message, Tunnel)
    return message.payload


def test_a_goal_that_was_told_is_known_for_two_seconds() -> None:
    goals = ToldGoals(Source(12, 1), ORIGIN)
    goals.receive(1_000_000, 11, told())
    known = goals.recent(3_000_000)[11]
    assert known.position_m == pytest.approx(GOAL)
    assert not known.reached
    assert goals.recent(3_000_001) == {}


def test_the_newest_goal_counts() -> None:
    goals = ToldGoals(Source(12, 1), ORIGIN)
    goals.receive(1_000_000, 11, told())
    goals.receive(2_000_000, 11, told(reached=True))
    assert goals.recent(4_000_000)[11].reached


def test_a_goal_in_another_frame_does_not_count_and_one_that_cannot_be_decoded_is_refused() -> None:
    goals = ToldGoals(Source(12, 1), ORIGIN)
    goals.receive(0, 11, told(origin=8))
    assert goals.recent(0) == {}
    with pytest.raises(PlanWireError, match="goal of 3 bytes"):
        goals.receive(0, 11, b"abc")


def test_who_has_no_goal_tells_none() -> None:
    sender = ToldGoals(Source(11, 1), ORIGIN)
    assert sender.messages() == []
    sender.tell(GOAL)
    assert len(sender.messages()) == 1
    sender.tell(None)
    assert sender.messages() == []
