"""Vehicles that follow their destinations turn to the best bearings, hidden ones leave theirs."""

from __future__ import annotations

import numpy as np
import pytest

from companion.config import CompanionConfig
from companion.config.formation import Perception
from companion.goals.perception import PerceptionFormation
from companion.goals.viewpoints import anisotropy, weight
from companion.values.bearings import turned
from companion.values.mates import Mates, Sight
from tests.companion.rig import CIRCLE

TARGET = np.array([2.0, 1.0, 0.0])
AHEAD = 1.6
STEP = 0.1


def formations(count: int, settings=None, **others) -> list[PerceptionFormation]:
    config = CompanionConfig.model_validate(
        {"formation": {"kind": "perception", **(settings or {})}, **others}
    )
    assert isinstance(config.formation, Perception)
    return [PerceptionFormation(config, config.formation, 11 + k, AHEAD) for k in range(count)]


def flown(bearings, fleet, seconds: float = 20.0, loss: float = 0.0, sight: Sight | None = None):
    """Bearings after a time in which each follows its destination, by what it last received of the others."""
    random = np.random.default_rng(len(fleet))
    here = [TARGET + CIRCLE.nearest(np.array([np.cos(b), np.sin(b), 0.0])) for b in bearings]
    known = [list(here) for _ in here]
    for tick in range(round(seconds / STEP)):
        ends = []
        for k, formation in enumerate(fleet):
            others = [j for j in range(len(here)) if j != k]
            for j in others:
                known[k][j] = here[j] if random.uniform() >= loss else known[k][j]
            mates = Mates(
                tuple(11 + j for j in others), np.array([known[k][j] for j in others]).reshape(-1, 3)
            )
            offset = here[k] - TARGET
            place = CIRCLE.nearest(offset)
            turn = formation.turn(round(1e6 * STEP * tick), TARGET, offset, place, mates, sight or Sight())
            # A vehicle comes as near to its destination in a horizon as this.
            ends.append(TARGET + turned(place, turn * STEP / AHEAD))
        here = ends
    off = np.array(here) - TARGET
    return np.arctan2(off[:, 1], off[:, 0])


def share(bearings, weights) -> float:
    return abs(anisotropy(bearings, np.asarray(weights, dtype=float))) / float(np.sum(weights))


def random_bearings(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng([seed, count]).uniform(-np.pi, np.pi, count)


@pytest.mark.parametrize("loss", [0.0, 0.2])
@pytest.mark.parametrize("count", [3, 5, 8])
def test_after_twenty_seconds_s_is_small(count, loss):
    ends = [
        share(flown(random_bearings(count, seed), formations(count), loss=loss), [1] * count)
        for seed in range(2)
    ]
    assert max(ends) < 0.05


def test_two_come_to_right_angles():
    for seed in range(2):
        first, second = flown(random_bearings(2, seed), formations(2))
        assert abs(np.degrees(np.arcsin(abs(np.sin(first - second)))) - 90.0) < 8.0


@pytest.mark.parametrize(("count", "most"), [(3, 0.23), (5, 0.05)])
def test_one_camera_three_times_as_good(count, most):
    """Its σ across the ray is smaller by √3, and so is that along it: the weight is three times as large."""
    better = {"vehicle": 11, "sigma_range": 0.75 / np.sqrt(3.0), "sigma_bearing_deg": 1.0 / np.sqrt(3.0)}
    for seed in range(2):
        fleet = formations(count, {"cameras": [better]})
        assert share(flown(random_bearings(count, seed), fleet), [3, *[1] * (count - 1)]) < most


def test_measured_weights_come_before_configured_ones():
    away = float(np.linalg.norm(CIRCLE.nearest(np.array([1.0, 0.0, 0.0]))))
    one = float(weight(0.75, 1.0, np.array([away]))[0])
    sight = Sight({11: one, 12: one, 13: 0.0})
    ends = flown(np.array([0.1, 0.5, 2.0]), formations(3), sight=sight)
    # The third sees nothing: the others stand at right angles as if it were not there.
    assert abs(np.sin(ends[0] - ends[1])) > np.sin(np.radians(82.0))


def test_a_hidden_bearing_is_left_and_not_come_back_to():
    at = TARGET + turned(np.array([2.0, 0.0, 0.0]), 0.0)
    post = {"kind": "post", "at": [float(at[0]), float(at[1])], "radius": 0.3}
    fleet = formations(1, obstacles=[post])
    (end,) = flown(np.array([0.02]), fleet)
    assert abs(end) >= np.arcsin(0.6 / 2.0) - 1e-3
    assert abs(flown(np.array([0.02]), formations(1))[0]) < 0.03


def test_a_turn_is_never_faster_than_its_speed():
    fleet = formations(2, {"speed": 0.5, "gain": 50.0})
    mates = Mates((12,), TARGET[None] + CIRCLE.nearest(np.array([1.0, 0.3, 0.0])))
    offset = CIRCLE.nearest(np.array([1.0, 0.0, 0.0]))
    turn = fleet[0].turn(0, TARGET, offset, offset, mates, Sight())
    assert abs(turn) == pytest.approx(0.5 * AHEAD / CIRCLE.radius)


def test_a_surface_without_a_radius_is_not_turned_along():
    place = np.array([0.0, 0.0, 5.0])
    assert formations(1)[0].turn(0, TARGET, place, place, Mates(), Sight()) == 0.0
