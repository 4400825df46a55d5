"""A whole companion beside a neighbour that it hears no more: the bounds reach its plans, and its aim."""

from __future__ import annotations

import numpy as np
import pytest

from companion.obstacles.unheard import Unheard
from companion.values.phase import Phase
from companion.values.speed_bounds import SpeedBounds, allowed
from tests.companion.bench import Bench, field_of, seen_at

SECOND = 1_000_000
SILENT = 12
PLACE = (8.0, 3.0, 5.0)
"""Beside the way, so that the field does not stop the vehicle."""


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[SpeedBounds | None]:
    """All bounds that were worked out."""
    found: list[SpeedBounds | None] = []
    bounds = Unheard.bounds

    def noted(self, now, heard, place):
        found.append(bounds(self, now, heard, place))
        return found[-1]

    monkeypatch.setattr(Unheard, "bounds", noted)
    return found


def under_way(said: list[SpeedBounds | None]) -> Bench:
    """On its way past a neighbour that has just fallen silent."""
    bench = Bench(task="goto", guard={"unheard_us": 300_000}, rates={"replan_us": 50_000})
    bench.take_off()
    for _ in range(50):
        received = bench.datagram("swarm", seen_at(SILENT, PLACE))
        bench.step(*([received] if bench.now % 100_000 == 0 else []))
    assert bench.phase is Phase.ESCORT
    bench.go_to((16, 0, 5))
    said.clear()
    return bench


def test_bounds_are_worked_out_once_for_each_plan(said: list[SpeedBounds | None]) -> None:
    """The aim and the plan use the same."""
    bench = under_way(said)
    field = field_of(bench.companion)
    before = field.tally.plans
    bench.fly(1.0)
    assert field.tally.plans - before == 20
    assert len(said) == 20
    assert field.plan is not None
    assert field.plan.aim.bounds is said[-1] is not None


def test_a_plan_and_its_aim_keep_the_bounds(said: list[SpeedBounds | None]) -> None:
    bench = under_way(said)
    field, fastest = field_of(bench.companion), []
    for _ in range(40):
        bench.fly(0.1)
        plan, bounds = field.plan, said[-1]
        if plan is None or bounds is None:
            continue
        speeds = np.linalg.norm(plan.horizon.knots[:, 3:6], axis=1)
        ahead = plan.horizon.knots[:, 0:3] - bounds.place
        most = allowed(
            np.maximum(bounds.gaps[0] - ahead @ bounds.normals[0], 0.0), bounds.braking, bounds.time
        )
        # A plan that begins too fast slows down first; the gap is that before each step.
        assert (speeds <= np.maximum(most, speeds[0]) + 0.01).all()
        seconds = 1e-6 * (plan.horizon.end - plan.horizon.epoch) + 1e-6 * plan.horizon.dt
        off = np.linalg.norm(plan.aim.destination - bounds.place)
        assert off <= seconds * bounds.along(plan.aim.destination - bounds.place) + 1e-6
        fastest.append(speeds[0])
    assert len(fastest) > 30
    assert max(fastest[20:]) < 1.0
    assert max(fastest) > 1.0
