"""Deadlock turn: resolves deadlocks in which plans certify each other.

A deadlock begins at the rest points, where the plans end, before the vehicles themselves stop. For example,
vehicles meet in the middle: after a second their rest points lie on a small circle, the planes let each rest
point move outward only, and the plan that stays is optimal. If a vehicle's planes push its plan back while
its rest point makes no progress, the goal is turned aside about the vehicle, for all vehicles to the same
side, and back again when the push is gone. The turn changes only the cost, and depends only on the vehicle's
own solutions. The constraints that certify separation do not change.

The push is F = Σ λ c, the sum of the planes' normals c times the multipliers λ of their rows. The blocking is
b = clip(−F·d / (G · L), 0, 1) · clip(1 − v_L/v, 0, 1). d and L are the direction and the distance of the goal
from the rest point, G is the gradient of the cost per metre of error, v_L the speed at which L falls, and v
the setting ``deadlock.speed``. If b exceeds ``deadlock.pushed`` the turn grows at a rate proportional to b;
otherwise it decreases. Pushes of vehicles that fly to the side of the turn and ahead do not count: a vehicle
that turned with them would pass them on the far side, with the goal on the near one.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from companion.config.certified import DeadlockConfig
from companion.values.bearings import turned
from companion.values.horizon import Array

_MIN_PULL_DISTANCE_M = 0.5
"""Distance of the goal below which the pull of the cost counts as constant."""
_MIN_GAIN_M = 0.05
_REACHED_M = 0.1
"""Progress: the rest point is nearer to the goal than ``_REACHED_M``, or ``_MIN_GAIN_M`` nearer than ever."""


class Pushes(NamedTuple):
    """Forces (M, 3) of planes, Σ λ c of each, and velocities (M, 3), m/s, of what is on their other sides.

    A velocity is the mean one of a plan from its beginning to its end.
    """

    forces: Array
    velocities: Array


class DeadlockTurn:
    """Turn of one vehicle's goal.

    ``sense``: +1 turns right.
    """

    def __init__(self, config: DeadlockConfig, sense: float = 1.0) -> None:
        self._config, self._sense = config, sense
        self.angle = 0.0
        """Angle (rad) by which the goal is turned now, to the side of ``sense``."""
        self._distance: float | None = None
        self._best = np.inf
        self._waited = 0.0

    def turned(self, position: Array, goal: Array, least: float = 0.0) -> Array:
        """Return the place (3,), m, to aim for from ``position`` (3,) instead of ``goal`` (3,).

        The goal is turned by ``least`` (rad) at least. On a turn above ``bend`` it is at most ``detour`` (m)
        away.
        """
        angle = max(self.angle, least)
        if angle == 0.0:
            return goal
        offset = goal - position
        length = sqrt(offset @ offset)
        if angle > self._config.bend and length > self._config.detour:
            offset = offset * (self._config.detour / length)
        return position + turned(offset, -self._sense * angle)

    @property
    def stalled(self) -> bool:
        """Whether there was no progress although the goal was turned by ``bend_more``."""
        config = self._config
        return self._waited > config.patience + (config.bend_more - config.bend) / config.slow

    def restart(self) -> None:
        """Measure progress anew, because the way to the goal is another one."""
        self._distance, self._best = None, np.inf

    def learn(
        self,
        rest: Array,
        goal: Array,
        pushes: Pushes,
        gradient_per_metre: float,
        seconds: float,
        beyond: float = 0.0,
        *,
        moving: bool = False,
    ) -> None:
        """Update the turn from the plan just made.

        The plan ends at rest at ``rest`` (3,), m. ``pushes``: of its planes. ``gradient_per_metre``: the
        gradient of its cost per metre of error. The previous plan was made ``seconds`` ago. ``beyond`` (m):
        length of the way from ``goal``, if that is a sub-goal. ``moving``: the goal moves; the distance from
        it then does not measure progress, and the turn stays below ``bend``.
        """
        config = self._config
        offset = goal - rest
        direct = sqrt(offset @ offset)
        distance = direct + beyond
        approach_speed = np.inf if self._distance is None else (self._distance - distance) / seconds
        self._distance = distance
        if moving:
            self._best, self._waited = np.inf, 0.0
        elif distance < self._best - _MIN_GAIN_M or distance < _REACHED_M:
            self._best, self._waited = min(distance, self._best), 0.0
        else:
            self._waited += seconds
        overtime = max(0.0, self._waited - config.patience)
        direction = offset / max(direct, 1e-6)
        push = pushes.forces.sum(axis=0) if moving else self._away(pushes, direction)
        push_back = -float(push @ direction)
        if overtime > 0.0:
            # After ``patience`` without progress, a push back along the turned direction counts, too.
            push_back = max(push_back, -float(push @ turned(direction, -self._sense * self.angle)))
        pushed = min(max(push_back / (gradient_per_metre * max(direct, _MIN_PULL_DISTANCE_M)), 0.0), 1.0)
        pushed *= min(max(1.0 - approach_speed / config.speed, 0.0), 1.0)
        if pushed > config.pushed:
            most = min(config.bend_more, config.bend + config.slow * overtime)
            self.angle = min(most, self.angle + config.up * seconds * pushed)
        else:
            self.angle = max(0.0, self.angle - config.down * seconds / (1.0 + overtime))

    def _away(self, pushes: Pushes, direction: Array) -> Array:
        """Return the force (3,) that the turn answers, for a goal in ``direction`` (3,).

        A vehicle that crosses to the side of the turn, and flies in about this direction as well, stays
        beside a vehicle that turns: its push does not count.
        """
        aside = turned(direction, -self._sense * 0.5 * np.pi)
        velocities = pushes.velocities / self._config.chase
        # np.clip costs four times as much for arrays as small as these.
        beside, ahead = (np.minimum(np.maximum(velocities @ way, 0.0), 1.0) for way in (aside, direction))
        result: Array = (1.0 - beside * ahead) @ pushes.forces
        return result
