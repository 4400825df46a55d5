"""Swivelling destination (Sec. III-C.1): the destination moves along the surface, the further the more is
left of the way.

x̌ = x_P + [d cos(ψ ± k_s‖∇J‖), d sin(ψ ± k_s‖∇J‖), h],  and so on any surface: the destination is turned about
the vertical through the target, and the nearest point of the surface is taken. A goal that is one point is
turned alike; either way it is back when nothing is left of the way.

Settled against the text. The gradient is its norm divided by Ω_t, for which k_s = 0.05 is meant, and it turns
the destination by a quarter at most. The paper turns by the sign of ψ, which spreads vehicles that come
from the west, gathers those that come from the east, and so depends on where north is. Here a vehicle turns
away from the side on which the others are, as seen from the target; who has nobody beside it need not swivel.
The sense is latched until the vehicle has all but arrived, otherwise two that are abreast chatter.
"""

from __future__ import annotations

from math import atan2, copysign, pi, sqrt

import numpy as np

from companion.avoidance.field.methods import Influence, Scene
from companion.config.planning import SwivelConfig, TurningSense
from companion.values.bearings import turned, wrapped

_MOST = 0.5 * pi
_BESIDE = 0.3
"""rad: how fast those further aside count less."""
_ABOVE = 0.1
"""m, horizontally: what is so near to the target's vertical has no bearing."""


class Swivel:
    """Turns the destination; latches one sense from the start to the arrival."""

    def __init__(self, config: SwivelConfig, turning: TurningSense) -> None:
        self._config = config
        self._turning = turning
        self._sense = 0.0

    def influence(self, scene: Scene, influence: Influence) -> Influence:
        """The influence with its destination turned."""
        steepness = sqrt(scene.gradient @ scene.gradient)
        if steepness < self._config.arrived:
            self._sense = 0.0
        elif self._sense == 0.0:
            self._sense = _away(scene)
            if self._sense and self._turning != "own":
                # Who passes a target on its right goes round it counter-clockwise.
                self._sense = 1.0 if self._turning == "right" else -1.0
        if self._sense == 0.0:
            return influence
        angle = self._sense * min(self._config.k_s * steepness, _MOST)
        offset = turned(influence.destination - scene.target_end, angle)
        if scene.surface is not None:
            offset = scene.surface.nearest(offset)
        return influence._replace(destination=scene.target_end + offset)


def _away(scene: Scene) -> float:
    """+1 to turn counter-clockwise as seen from above, −1 clockwise, 0 for no reason to turn."""
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
