"""Gymnasium vector environment: in each part one vehicle learns to escort a moving target."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from outrider.arguments import number, whole
from outrider.errors import InputError
from outrider.sim.batch import Batch
from sitl.vehicle.airframe import FloatArray
from sitl.vehicle.config import VehicleConfig

_LOOK = 12
"""Number of observed values."""
_FAR_M = 20.0
"""Distance from the target at which an episode ends."""
_PACE_M_S = 1.5
"""Largest speed of the target."""


class EscortVectorEnv(VectorEnv[NDArray[np.float32], FloatArray, NDArray[Any]]):
    """``num_envs`` vehicles, each beside a target of its own that walks straight on level ground.

    Action (3,), −1 to 1: the commanded acceleration over ``max_acceleration`` (m/s², ENU), for ``steps``
    physics steps. Observation (12,), float32: the target's offset from the vehicle (m) and velocity relative
    to it (m/s), the vehicle's velocity (m/s) and its up axis, all ENU. Reward per step: −|d − ``radius``|/10
    with the distance d in space, minus 1 at the ground. An episode is terminated at the ground and 20 m from
    the target, and truncated after ``seconds``; the next step resets it. A seed determines everything.
    """

    def __init__(
        self,
        num_envs: int = 1,
        vehicle: str | Path | VehicleConfig = "firefly",
        *,
        steps: int = 8,
        radius: float = 5.0,
        max_acceleration: float = 5.0,
        seconds: float = 10.0,
    ) -> None:
        num_envs, steps = whole("num_envs", num_envs, least=1), whole("steps", steps, least=1)
        self._batch = Batch(vehicle, num_envs)
        self.num_envs, self._steps = num_envs, steps
        self._radius = number("radius", radius, "m", above=0.0)
        self._push = number("max_acceleration", max_acceleration, "m/s²", above=0.0)
        seconds = number("seconds", seconds, "s", above=0.0)
        self._longest = max(round(seconds / (steps * self._batch.dt)), 1)
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}
        self.single_action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (_LOOK,), np.float32)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._targets, self._walks = np.zeros((num_envs, 3)), np.zeros((num_envs, 3))
        self._ages = np.zeros(num_envs, dtype=np.int64)
        self._over = np.ones(num_envs, dtype=np.bool_)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin all episodes anew; return the observations (num_envs, 12) and no further information."""
        if isinstance(seed, list):
            raise InputError("seed: is a list; allowed: one whole number, from which all episodes follow")
        super().reset(seed=seed, options=options)
        self._begin(np.ones(self.num_envs, dtype=np.bool_))
        self._over[:] = False
        return self._observed(), {}

    def step(
        self, actions: FloatArray
    ) -> tuple[NDArray[np.float32], NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Advance all; return observations, rewards, terminated, truncated (num_envs, …), no information.

        An episode that had ended begins anew instead, with reward 0.
        """
        batch, begun = self._batch, self._over.copy()
        begins = bool(begun.any())
        if begins:
            self._begin(begun)
            kept = batch.save()[begun]
        push = self._push * np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0)
        if push.shape != (self.num_envs, 3):
            raise InputError(f"actions: has shape {push.shape}; allowed: ({self.num_envs}, 3)")
        batch.step(np.hstack([batch.positions, batch.velocities, push]), self._steps)
        if begins:
            # An episode that begins now has not been acted on.
            states = batch.save()
            states[begun] = kept
            batch.load(states)
        self._targets[~begun] += self._steps * batch.dt * self._walks[~begun]
        self._ages[~begun] += 1
        distance = np.linalg.norm(self._targets - batch.positions, axis=1)
        fallen = batch.on_ground
        terminated = (fallen | (distance > _FAR_M)) & ~begun
        truncated = (self._ages >= self._longest) & ~terminated & ~begun
        rewards = np.where(begun, 0.0, -np.abs(distance - self._radius) / 10.0 - fallen)
        self._over = terminated | truncated
        return self._observed(), rewards, terminated, truncated, {}

    def _begin(self, which: NDArray[np.bool_]) -> None:
        """Place the vehicles and the targets of the parts ``which`` (num_envs,) at random."""
        count, random = int(which.sum()), self.np_random
        course = random.uniform(0.0, 2.0 * np.pi, count)
        pace = random.uniform(0.0, _PACE_M_S, count)
        self._targets[which] = 0.0
        self._walks[which] = np.column_stack([pace * np.cos(course), pace * np.sin(course), np.zeros(count)])
        around = random.uniform(0.0, 2.0 * np.pi, count)
        away = random.uniform(1.0, 2.0, count) * self._radius
        heights = random.uniform(3.0, 8.0, count)
        places = np.column_stack([away * np.cos(around), away * np.sin(around), heights])
        self._batch.reset(which, positions=places, yaws=random.uniform(-np.pi, np.pi, count))
        self._ages[which] = 0

    def _observed(self) -> NDArray[np.float32]:
        """Return the observations (num_envs, 12)."""
        batch = self._batch
        positions, velocities = batch.positions, batch.velocities
        w, x, y, z = batch.attitudes.T
        up = np.column_stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])
        parts = [self._targets - positions, self._walks - velocities, velocities, up]
        return np.hstack(parts).astype(np.float32)
