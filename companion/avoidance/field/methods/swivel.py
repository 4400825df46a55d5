"""Swivelling destination (Sec. III-D.1): the destination moves along the surface.

x̌ = x_P + [d cos(ψ ± k_s‖∇J‖), d sin(ψ ± k_s‖∇J‖), h], eq. (12), on the paper's surface: a circle of radius
d, at the height h, about the target x_P. ψ is the bearing of the vehicle from the target. The longer the rest
of the way, the larger is ‖∇J‖ and the angle. On any other surface, too, the destination is turned about the
vertical through the target by this angle, and then moved to the nearest point of the surface. A goal that is
one point is turned about the target as well. At the end of the way the angle is zero.

Deviations from the paper. ‖∇J‖ is the norm of the gradient divided by Ω_t, in m; the paper's k_s = 0.05
belongs to a gradient of another scale. The angle is at most a quarter turn. In the paper the sign of ψ
selects the side, so the result depends on where north is. Here, with the turning sense ``own``, a vehicle
turns away from the side on which most obstacles (vehicles and others) are, as seen from the target. With a
common turning sense every vehicle turns to that side. A vehicle does not turn if nothing is around the
target, or if both sides balance. The side is latched at the first reason to turn, until the vehicle has
almost arrived; otherwise two vehicles abreast chatter.
"""

from __future__ import annotations

from math import atan2, copysign, pi, sqrt

import numpy as np

from companion.avoidance.field.methods import Influence, Scene
from companion.config.planning import SwivelConfig, TurningSense
from companion.values.bearings import turned, wrapped

_MOST = 0.5 * pi
_BESIDE = 0.3
"""Difference of bearings (rad) at which the weight of an obstacle has fallen to 1/e."""
_ABOVE = 0.1
"""Horizontal distance (m) from the target's vertical below which an obstacle has no bearing.

For the own vehicle it is the larger of the two coordinates.
"""


class Swivel:
    """Turn of the destination; latches the side at the first reason to turn, until the arrival."""

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
