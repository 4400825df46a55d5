"""Tangential band (Sec. III-D.3): a force perpendicular to the line from the obstacle to the vehicle.

Inside a band around an obstacle, F_tang acts, and the terminal weight Ω_t is lowered, eq. (17).

F_tang(0) = k_tang ‖∇J‖ α̂,  α̂ ⊥ α, eq. (16), the same for the whole horizon. Eq. (18) adds it to the
repulsion. α is the direction from the obstacle to the vehicle, ∇J the gradient of the cost at the end of the
last plan.

Deviations from the paper. ‖∇J‖ is divided by Ω_t. The band reaches from the obstacle to d_safe + d_band, and
further for an obstacle that closes fast (``reach_s`` times the closing speed), because turning aside takes a
given time. The force grows from zero at the band's edge, first steeply to u_max (which the input can cancel),
then to ``force_max`` at ``d_full``. It acts in full up to 60° from the direction to the destination, and
vanishes at 90°, so that the band is left once the obstacle is passed. It vanishes for obstacles more than
d_safe beyond the destination, and when the vehicle has almost arrived. The sense of an obstacle is kept while
its weight is positive; otherwise it would alternate when the bearing crosses zero. With a common turning
sense an obstacle may be on the side on which it is not to be passed. The force about it then points away from
the destination, and fades out with the bearing to that side (``wrong_side``): the whole force pushes vehicles
out of a ring. Where all ways cross in one place, the whole force makes the vehicles turn about that place.
Obstacles less than ``gap`` apart share one sense; otherwise a vehicle would be steered into a U-shaped group.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from companion.avoidance.field.methods import Influence, Scene
from companion.avoidance.field.methods.fading import reserve, share, shares
from companion.config.planning import TangentialConfig, TurningSense
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles

_COSINE_FULL = 0.5
"""Cosine of the angle between the directions to the destination and to the obstacle (60°).

Up to that angle the force is whole; it vanishes at 90°.
"""
_STEEP = 2.0
"""1/cos of the elevation (60°) up to which the force is whole; it vanishes straight above and below."""
_QUICK = 10.0
"""The part of the force up to u_max is whole at 1/``_QUICK`` of the full weight."""
_NEAR = 1e-6
_THERE, _ON_THE_WAY = 0.5, 1.5
"""Distance (m) to the destination up to which the force is zero, and from which it is whole.

In a moving formation this distance is a few tenths of a metre in changing directions; a lateral force would
push the vehicle out of its place.
"""
_SLOW, _SOON = 0.5, 3.0
"""Speed (m/s) that regularises the time of closest approach, and the longest such time (s)."""
_RIGHT: Array = np.array([1.0])
_LEFT: Array = np.array([-1.0])


class Tangential:
    """Band around every obstacle; latches one turning sense per obstacle id."""

    def __init__(self, config: TangentialConfig, turning: TurningSense, u_max: float, dt: float) -> None:
        self._config = config
        self._turning = turning
        self._u_max = u_max
        self._dt = dt
        self._sense: dict[int, float] = {}

    def influence(self, scene: Scene, influence: Influence) -> Influence:
        """Add F_tang of every obstacle ahead in whose band the vehicle is."""
        obstacles = scene.obstacles
        if not obstacles.ids:
            self._sense.clear()
            return influence
        away = scene.position - obstacles.positions[:, 0]
        square = away * away
        flat = np.sqrt(square[:, 0] + square[:, 1]) + _NEAR
        distance = np.sqrt(square.sum(axis=1)) + _NEAR
        # An obstacle straight above or below has no horizontal passing direction.
        weight = self._weights(scene, away, distance) * shares(_STEEP * flat / distance)
        self._release(obstacles, weight)
        # α̂ = ± ẑ × α is horizontal: the force does not change the height.
        senses = self._senses(obstacles, weight, away, scene.to_go)
        if self._turning != "own" and self._config.wrong_side is not None:
            weight = weight * _onward(senses, away, flat, scene.to_go, *self._config.wrong_side)
        signed = weight * senses / flat
        total = np.array([-(signed @ away[:, 1]), signed @ away[:, 0], 0.0])
        norm = sqrt(total @ total)
        if norm < _NEAR:
            return influence
        whole = min(norm, 1.0)
        config, u_max = self._config, self._u_max
        strength = min(
            config.k_tang * sqrt(scene.gradient @ scene.gradient),
            u_max * min(1.0, _QUICK * whole) + (config.force_max - u_max) * whole,
        )
        direction = total / norm
        # The force falls with the speed along it, to zero at the speed from which half of u_max stops within
        # the distance to the destination.
        sideways = float((scene.velocity - scene.destination_velocity) @ direction)
        most = min(config.pass_speed, sqrt(u_max * sqrt(scene.to_go @ scene.to_go)) + _NEAR)
        strength *= share(reserve(sideways, most))
        return influence._replace(
            force=influence.force + direction * strength, omega_scale=config.omega_scale
        )

    def _weights(self, scene: Scene, away: Array, distance: Array) -> Array:
        """Return how much each obstacle's band acts, (M,) in 0…1.

        ``away`` (M, 3), m, leads from the obstacles to the vehicle; ``distance`` (M,) are its norms.
        """
        config, obstacles = self._config, scene.obstacles
        moving = (obstacles.positions[:, 1] - obstacles.positions[:, 0]) / self._dt
        closing = np.maximum(np.vecdot(away, moving - scene.velocity) / distance, 0.0)
        edge = obstacles.d_safe + config.d_band + config.reach_s * closing
        depth = shares((edge - distance) / (edge - config.d_full - obstacles.radius))
        to_go = scene.to_go
        length = sqrt(to_go @ to_go) + _NEAR
        along = -(away @ to_go) / length
        ahead = shares(along / (_COSINE_FULL * distance))
        before = shares(1.0 + (length - along) / obstacles.d_safe)
        before *= share((length - _THERE) / (_ON_THE_WAY - _THERE))
        weights: Array = depth * ahead * before * self._meeting(obstacles, away, moving - scene.velocity)
        return weights

    def _meeting(self, obstacles: Obstacles, away: Array, velocity: Array) -> Array:
        """Return a share (0…1) by the closest approach of each obstacle at constant velocities.

        1 is within ``d_full``, 0 is d_safe or more.

        ``velocity`` (M, 3), m/s, is relative to the own velocity.
        """
        config = self._config
        square = np.vecdot(velocity, velocity) + _SLOW**2
        time = np.minimum(np.maximum(np.vecdot(away, velocity) / square, 0.0), _SOON)
        miss = away - time[:, None] * velocity
        distance = np.sqrt(np.vecdot(miss, miss))
        return shares((obstacles.d_safe - distance) / (obstacles.d_safe - config.d_full - obstacles.radius))

    def _release(self, obstacles: Obstacles, weight: Array) -> None:
        if not self._sense:
            return
        for name in set(self._sense).difference(
            name for name, w in zip(obstacles.ids, weight, strict=True) if w > 0.0
        ):
            del self._sense[name]

    def _senses(self, obstacles: Obstacles, weight: Array, away: Array, to_go: Array) -> Array:
        """Return +1 per obstacle for counter-clockwise about it as seen from above, −1 for clockwise.

        An obstacle passed counter-clockwise stays on the left.
        """
        config = self._config
        if self._turning != "own":
            return _RIGHT if self._turning == "right" else _LEFT
        senses = np.zeros(len(weight))
        acting = np.flatnonzero(weight > 0.0)
        new = [j for j in acting if obstacles.ids[j] not in self._sense]
        if new:
            for group in groups(
                away[acting, :2], np.broadcast_to(obstacles.radius, len(weight))[acting], config.gap
            ):
                self._latch([int(acting[j]) for j in group], obstacles, weight, away, to_go)
        for j in acting:
            senses[j] = self._sense[obstacles.ids[j]]
        return senses

    def _latch(
        self, group: list[int], obstacles: Obstacles, weight: Array, away: Array, to_go: Array
    ) -> None:
        """Latch the sense of the obstacles that are new in a group.

        It is the sense of the group, or else follows from the side on which most of the group is.
        """
        names = [obstacles.ids[j] for j in group]
        known = [
            (weight[j], self._sense[name])
            for j, name in zip(group, names, strict=True)
            if name in self._sense
        ]
        heaviest = max(known, default=(0.0, 0.0))[0]
        senses = {sense for w, sense in known if w == heaviest}
        if len(senses) == 1:
            sense = senses.pop()
        else:
            # A group to the left of the course stays on the left.
            x, y = (weight[group, None] * away[group, :2]).sum(axis=0)
            sense = 1.0 if to_go[1] * x - to_go[0] * y >= 0.0 else -1.0
        for name in names:
            self._sense.setdefault(name, sense)


def _onward(senses: Array, away: Array, flat: Array, to_go: Array, whole: float, zero: float) -> Array:
    """Return the share (0…1) of the force about each obstacle, (M,), with a common turning sense.

    The share falls where the force points away from the destination: from 1 at the sine ``whole`` of the
    bearing to 0 at the sine ``zero``. ``away`` (M, 3), m, leads from the obstacles to the vehicle; ``flat``
    (M,) are its horizontal norms.
    """
    length = sqrt(to_go @ to_go) + _NEAR
    sine = senses * (away[:, 0] * to_go[1] - away[:, 1] * to_go[0]) / (flat * length)
    return shares((sine + zero) / (zero - whole))


def groups(places: Array, radius: Array, gap: float) -> list[list[int]]:
    """Return groups of indices of ``places`` (m, 2), m.

    Places belong to one group if they are connected by gaps of less than ``gap`` (m) between their surfaces.
    """
    count = len(places)
    off = places[:, None] - places[None, :]
    size = np.broadcast_to(radius, count)
    near = np.hypot(off[..., 0], off[..., 1]) - size[:, None] - size[None, :] < gap
    left, found = set(range(count)), []
    while left:
        group, todo = [], [left.pop()]
        while todo:
            one = todo.pop()
            group.append(one)
            joined = [other for other in left if near[one, other]]
            left.difference_update(joined)
            todo += joined
        found.append(sorted(group))
    return found
