"""Swivelling destination (Sec. III-D.1): the destination moves along the surface.

x̌ = x_P + [d cos(ψ ± k_s‖∇J‖), d sin(ψ ± k_s‖∇J‖), h], eq. (12): it moves the further, the more is left of
the way. On any other surface the destination is likewise turned about the vertical through the target, and
the nearest point of the surface is taken. A goal that is one point is turned alike. In all cases the
destination is back when nothing is left of the way.

Deviations from the paper. The gradient is its norm divided by Ω_t, for which k_s = 0.05 is meant, and it
turns the destination by a quarter turn at most. The paper turns by the sign of ψ. That spreads vehicles that
come from the west and gathers those that come from the east, and so depends on where north is. Here a vehicle
turns away from the side on which the others are, as seen from the target; a vehicle without others beside it
need not swivel. The sense is latched until the vehicle has almost arrived; otherwise two vehicles abreast
chatter.
"""

from __future__ import annotations

from math import atan2, copysign, pi, sqrt

import numpy as np

from companion.avoidance.field.methods import Influence, Scene
from companion.config.planning import SwivelConfig, TurningSense
from companion.values.bearings import turned, wrapped

_MOST = 0.5 * pi
_BESIDE = 0.3
"""Angle (rad) over which the weight of others falls by 1/e with their distance aside."""
_ABOVE = 0.1
"""Horizontal distance (m) from the target's vertical below which there is no bearing."""


class Swivel:
    """Turn of the destination; latches one sense from the start to the arrival."""

    def __init__(self, config: SwivelConfig, turning: TurningSense) -> None:
        self._config = config
        self._turning = turning
        self._sense = 0.0

    def influence(self, scene: Scene, influence: Influence) -> Influence:
        """Return the influence with its destination turned."""
        steepness = sqrt(scene.gradient @ scene.gradient)
        if steepness < self._config.arrived:
            self._sense = 0.0
        elif self._sense == 0.0:
            self._sense = _away(scene)
            if self._sense and self._turning != "own":
                # A vehicle that passes to the right of a target goes round it counter-clockwise.
                self._sense = 1.0 if self._turning == "right" else -1.0
        if self._sense == 0.0:
            return influence
        angle = self._sense * min(self._config.k_s * steepness, _MOST)
        offset = turned(influence.destination - scene.target_end, angle)
        if scene.surface is not None:
            offset = scene.surface.nearest(offset)
        return influence._replace(destination=scene.target_end + offset)


def _away(scene: Scene) -> float:
    """Return +1 to turn counter-clockwise as seen from above, −1 clockwise, 0 without a reason to turn."""
    obstacles = scene.obstacles
    if not obstacles.ids:
        return 0.0
    off = obstacles.positions[:, 0, :2] - scene.target[:2]
    own = scene.position[:2] - scene.target[:2]
    seen = np.hypot(off[:, 0], off[:, 1]) > _ABOVE
    if not seen.any() or max(abs(own)) < _ABOVE:
        return 0.0
    aside = wrapped(atan2(own[1], own[0]) - np.arctan2(off[seen, 1], off[seen, 0]))
    total = float(np.sum(np.sign(aside) * np.exp(-np.abs(aside) / _BESIDE)))
    return copysign(1.0, total) if total else 0.0
