"""Deadlock turn: resolves deadlocks in which plans certify each other.

The vehicles do not jam first, but the places where their plans come to rest: after a second these form a
tight ring, each wedge of planes opens outward, and staying is the optimum. A vehicle whose plan is pushed
back by its planes while its rest point makes no progress turns its goal aside about itself, all vehicles to
one side, and back again when the push is gone. Only the cost changes, and only by the vehicle's own
solutions: nothing that certifies changes.

The push is F = Σ λ c, the sum of the planes' rows times their multipliers. The blocking is
b = clip(−F·d / (G · L), 0, 1) · clip(1 − v_L/v, 0, 1). d and L are the direction and the distance of the goal
from the rest point, G is the gradient of the cost per metre of error, v_L the speed at which L falls, and v
the setting ``deadlock.speed``.
"""

from __future__ import annotations

import numpy as np

from companion.config.certified import DeadlockConfig
from companion.values.bearings import turned
from companion.values.horizon import Array

_NEAREST = 0.5
"""Distance (m) of the goal within which the pull no longer falls."""
_BETTER = 0.05
_THERE = 0.1
"""Distance (m) within which nothing is in the way; ``_BETTER`` (m) is the least gain on the best distance."""


class DeadlockTurn:
    """Turn of one vehicle's goal.

    ``gradient_per_metre``: gradient of the cost per metre of error. ``sense``: +1 turns right.
    """

    def __init__(self, config: DeadlockConfig, gradient_per_metre: float, sense: float = 1.0) -> None:
        self._config, self._gradient_per_metre, self._sense = config, gradient_per_metre, sense
        self.angle = 0.0
        """Angle (rad) by which the goal is turned now, to the side of ``sense``."""
        self._left: float | None = None
        self._best = np.inf
        self._waited = 0.0

    def turned(self, position: Array, goal: Array) -> Array:
        """Return the place (3,), m, to aim for from ``position`` (3,) instead of ``goal`` (3,).

        On a large turn it is no further than ``detour``.
        """
        way = goal - position
        length = float(np.sqrt(way @ way))
        if self.angle > self._config.bend and length > self._config.detour:
            way = way * (self._config.detour / length)
        return position + turned(way, -self._sense * self.angle)

    def learn(self, rest: Array, goal: Array, push: Array, seconds: float) -> None:
        """Update the turn from the plan just made.

        The plan rests at ``rest`` (3,), m, its planes push with ``push`` (3,), and the last one was made
        ``seconds`` ago.
        """
        config = self._config
        way = goal - rest
        left = float(np.sqrt(way @ way))
        direction = way / max(left, 1e-6)
        gaining = np.inf if self._left is None else (self._left - left) / seconds
        self._left = left
        if left < self._best - _BETTER or left < _THERE:
            self._best, self._waited = min(left, self._best), 0.0
        else:
            self._waited += seconds
        over = max(0.0, self._waited - config.patience)
        against = -float(push @ direction)
        if over > 0.0:
            # In a trap that does not move, a push back along the turned way counts, too.
            against = max(against, -float(push @ turned(direction, -self._sense * self.angle)))
        pushed = min(max(against / (self._gradient_per_metre * max(left, _NEAREST)), 0.0), 1.0)
        pushed *= min(max(1.0 - gaining / config.speed, 0.0), 1.0)
        if pushed > config.pushed:
            most = min(config.bend_more, config.bend + config.slow * over)
            self.angle = min(most, self.angle + config.up * seconds * pushed)
        else:
            self.angle = max(0.0, self.angle - config.down * seconds / (1.0 + over))
