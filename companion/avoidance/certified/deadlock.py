"""The stall turn: what unfreezes plans that certify each other into a deadlock.

Not the vehicles jam first but the places where their plans come to rest: after a second these stand on a
tight ring, each wedge of planes opens outward, and staying is the optimum. A plan that is pushed back by its
planes while its rest point gets nowhere turns its goal aside about the vehicle, all to one side, and back
again when the push is gone. Only the cost changes, and only by what the vehicle itself has solved: nothing
that certifies.

F = Σ λ c over the planes' rows is the push; b = clip(−F·d / (pull · L), 0, 1) · clip(1 − ġ/v, 0, 1) with d
and L the direction and the distance of the goal from the rest point, ġ the speed at which L falls.
"""

from __future__ import annotations

import numpy as np

from companion.config.certified import StallConfig
from companion.values.bearings import turned
from companion.values.horizon import Array

_NEAREST = 0.5
"""m: a goal that is nearer pulls as from here."""
_BETTER = 0.05
_THERE = 0.1
"""m: by which a best distance is beaten, and within which nothing is in the way."""


class DeadlockTurn:
    """The turn of one vehicle's goal. ``pull``: the cost's, per metre; ``sense`` +1 turns right."""

    def __init__(self, config: StallConfig, pull: float, sense: float = 1.0) -> None:
        self._config, self._pull, self._sense = config, pull, sense
        self.angle = 0.0
        """rad by which the goal is turned now, to the side of ``sense``."""
        self._left: float | None = None
        self._best = np.inf
        self._waited = 0.0

    def turned(self, position: Array, goal: Array) -> Array:
        """Where to aim for from ``position`` (3,) instead of ``goal`` (3,): on a large turn no further than a
        detour leads."""
        way = goal - position
        length = float(np.sqrt(way @ way))
        if self.angle > self._config.bend and length > self._config.detour:
            way = way * (self._config.detour / length)
        return position + turned(way, -self._sense * self.angle)

    def learn(self, rest: Array, goal: Array, push: Array, seconds: float) -> None:
        """What the plan that was just made tells: it rests at ``rest`` (3,), its planes push with ``push``
        (3,), and the last one was made ``seconds`` ago."""
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
            # In a trap that does not move, what pushes back along the turned way counts too.
            against = max(against, -float(push @ turned(direction, -self._sense * self.angle)))
        pushed = min(max(against / (self._pull * max(left, _NEAREST)), 0.0), 1.0)
        pushed *= min(max(1.0 - gaining / config.speed, 0.0), 1.0)
        if pushed > config.pushed:
            most = min(config.bend_more, config.bend + config.slow * over)
            self.angle = min(most, self.angle + config.up * seconds * pushed)
        else:
            self.angle = max(0.0, self.angle - config.down * seconds / (1.0 + over))
