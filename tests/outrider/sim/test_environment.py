"""The Gymnasium environment keeps the interface's rules, and a policy can do well in it."""

from __future__ import annotations

import numpy as np
import pytest

from outrider import InputError
from outrider.sim import EscortVectorEnv

RADIUS = 5.0


def escort(seen: np.ndarray) -> np.ndarray:
    """Acceleration towards the sphere around the target, with damping: a policy by hand."""
    offset, drift = seen[:, :3], seen[:, 3:6]
    distance = np.linalg.norm(offset, axis=1, keepdims=True)
    wanted = offset / distance * (distance - RADIUS)
    return np.asarray((1.5 * wanted + 2.0 * drift) / 5.0)


def test_a_policy_by_hand_escorts_and_a_seed_determines_all() -> None:
    ended = []
    for _ in range(2):
        env = EscortVectorEnv(8, radius=RADIUS)
        seen, info = env.reset(seed=4)
        assert not info
        for _ in range(400):
            seen, rewards, terminated, truncated, _ = env.step(escort(seen))
            assert env.observation_space.contains(seen)
            assert not terminated.any()
            assert not truncated.any()
        assert rewards.min() > -0.1
        ended.append(seen)
    assert np.array_equal(*ended)


def test_an_episode_ends_and_the_next_step_begins_another() -> None:
    env = EscortVectorEnv(3, seconds=0.2)
    env.reset(seed=1)
    flags = [env.step(np.zeros((3, 3)))[3].all() for _ in range(23)]
    assert flags == [k % 11 == 9 for k in range(23)]


def test_the_ground_ends_an_episode() -> None:
    env = EscortVectorEnv(2, seconds=60.0)
    env.reset(seed=1)
    down = np.tile([0.0, 0.0, -1.0], (2, 1))
    for _ in range(600):
        _, rewards, terminated, _, _ = env.step(down)
        if terminated.any():
            break
    assert terminated.any()
    assert (rewards[terminated] <= -1.0).all()


def test_wrong_actions_are_refused() -> None:
    env = EscortVectorEnv(2)
    env.reset(seed=1)
    with pytest.raises(InputError, match=r"actions: has shape \(3, 3\)"):
        env.step(np.zeros((3, 3)))
