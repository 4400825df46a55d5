"""Approach angle (Sec. III-D.2): a force around the target separates the vehicles' angles of approach.

F_ang(n) = ‖∇J‖ F_hyp((θ_k(n) − θ_j(n))²) β̂,  β̂ ⊥ β = (x_R(n) − x_P)/‖x_R(n) − x_P‖,  horizontal.

k is the own vehicle, j an obstacle, x_R(n) the own predicted position, x_P the target. Eq. (15) adds the
force to the repulsion.

These are eqs. (13) and (14), with deviations from the paper. ‖∇J‖ is divided by Ω_t. θ is the bearing from
the target; a difference of two is wrapped before it is squared, and F_hyp has thresholds of its own in rad².
β̂ points to where the difference grows, so β is taken from the target: taken from the destination, as
printed, it reverses where the vehicle passes the circle, and inside the circle it points to where the
difference shrinks. With the turning sense ``own``, the sign of β̂ for an obstacle is latched for as long as a
force acts; otherwise it would alternate between two vehicles at one angle. Only others that may be met count:
not those further off than ``reach``, and not those that are further from the destination than the vehicle by
more than d_safe. The sum is clamped to ``force_max``, above u_max, or the input would cancel it. A vehicle
that already moves fast at a right angle to β is not pushed further.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.field.forces import magnitude
from companion.avoidance.field.methods import Influence, Scene
from companion.avoidance.field.methods.fading import reserve, shares
from companion.config.planning import FADING, ApproachAngleConfig, TurningSense
from companion.values.bearings import wrapped
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles
from companion.values.vectors import limit

_NEAR = 1e-6


class ApproachAngle:
    """Field of angles; latches one sense per obstacle id."""

    def __init__(self, config: ApproachAngleConfig, turning: TurningSense) -> None:
        self._config = config
        self._turning = turning
        self._sense: dict[int, float] = {}

    def influence(self, scene: Scene, influence: Influence) -> Influence:
        """Return the influence with Σ_j F_ang(n) on the predicted positions added."""
        config, obstacles = self._config, scene.obstacles
        if not obstacles.ids:
            self._sense.clear()
            return influence
        out = scene.prediction[:, :2] - scene.target[:2]
        aside = _aside(out, scene)
        square = aside * aside
        strength = magnitude(square, _of(config.d_min), _of(config.d_safe), config.gain, config.force_max)
        strength *= sqrt(scene.gradient @ scene.gradient) * self._met(scene)
        senses = self._senses(obstacles, aside, strength > 0.0)
        reach = np.hypot(out[:, 0], out[:, 1])
        beta = out / np.maximum(reach, _NEAR)[:, None]
        total = (senses @ strength) * np.minimum(reach / FADING, 1.0)
        # A vehicle that already moves fast across β in the direction of the force is not made faster.
        across = scene.velocity[1] * beta[:, 0] - scene.velocity[0] * beta[:, 1]
        total *= shares(reserve(np.sign(total) * across, config.pass_speed))
        force = np.zeros_like(influence.force)
        force[:, 0], force[:, 1] = -total * beta[:, 1], total * beta[:, 0]
        return influence._replace(force=influence.force + limit(force, config.force_max))

    def _met(self, scene: Scene) -> Array:
        """Return (M, 1): 1 for obstacles that may still be met, 0 for those left behind or too far off.

        Over ``FADING`` (m) in between, the values fall from 1 to 0.
        """
        obstacles = scene.obstacles
        left = sqrt(scene.to_go @ scene.to_go)
        goal = scene.position + scene.to_go
        off = obstacles.positions[:, 0] - goal
        ahead = shares(1.0 + (left + obstacles.d_safe - np.sqrt(np.vecdot(off, off))) / FADING)
        here = obstacles.positions[:, 0] - scene.position
        room = self._config.reach - np.sqrt(np.vecdot(here, here))
        ahead *= shares(1.0 + room / FADING)
        return ahead[:, None]

    def _senses(self, obstacles: Obstacles, aside: Array, acts: NDArray[np.bool_]) -> Array:
        """Return +1 per obstacle for a larger bearing from the target, −1 for a smaller one.

        ``acts`` (M, N + 1) is true where a force acts that needs a sense.
        """
        if self._turning != "own":
            # A vehicle that approaches the target has ẑ × β on its right.
            return np.full(len(obstacles.ids), 1.0 if self._turning == "right" else -1.0)
        latched = self._sense
        met: NDArray[np.bool_] = np.asarray(acts.any(axis=1))
        for name in set(latched).difference(n for n, m in zip(obstacles.ids, met, strict=True) if m):
            del latched[name]
        for j in np.flatnonzero(met):
            latched.setdefault(obstacles.ids[j], 1.0 if aside[j, acts[j].argmax()] >= 0.0 else -1.0)
        # No force acts where nothing is latched: any sense is correct.
        return np.array([latched.get(name, 1.0) for name in obstacles.ids])


def _aside(out: Array, scene: Scene) -> Array:
    """Return θ_k(n) − θ_j(n), (M, N + 1), rad, with ``out`` (N + 1, 2) the own way relative to the target."""
    other = scene.obstacles.positions[:, :, :2] - scene.target[:2]
    return wrapped(np.arctan2(out[:, 1], out[:, 0]) - np.arctan2(other[..., 1], other[..., 0]))


def _of(value: float) -> Array:
    return np.array([[value]])
