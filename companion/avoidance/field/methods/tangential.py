"""Tangential band (Sec. III-D.3): a force perpendicular to the line from the obstacle to the vehicle.

Inside a band around an obstacle, F_tang acts, and the terminal weight Ω_t is lowered, eq. (17).

F_tang(0) = k_tang ‖∇J‖ α̂,  α̂ ⊥ α, eq. (16), the same for the whole horizon. Eq. (18) adds it to the
repulsion. α is the direction from the obstacle to the vehicle, ∇J the gradient of the cost at the end of the
last plan.

Deviations from the paper. ‖∇J‖ is divided by Ω_t. The band reaches from the obstacle to d_safe + d_band, and
further for an obstacle that closes fast (``reach_s`` times the closing speed), because turning aside takes a
given time. The force k_tang ‖∇J‖ is limited. The limit grows from zero at the band's edge, first steeply to
about u_max (which the input can cancel), then to ``force_max`` at ``d_full`` plus the obstacle's radius. The
force acts in full up to 60° from the direction to the destination, and vanishes at 90°, so that the band is
left once the obstacle is passed. It vanishes for obstacles more than d_safe beyond the destination, and when
the vehicle has almost arrived. The sense of an obstacle is kept while its weight is positive; otherwise it
would alternate when the bearing crosses zero. With a common turning sense an obstacle may be on the side on
which it is not to be passed. The force about it then points away from the destination, and fades out with the
bearing to that side (``wrong_side``). Without this fading the force would push vehicles that surround a
target out of their places. A scenario in which the courses of all vehicles cross at one point does without
it: there the unfaded force makes the vehicles circle about that point in the common sense. An obstacle that
is newly latched takes the sense of the obstacles connected to it by gaps of less than ``gap``; otherwise a
vehicle would be steered into a U-shaped group.
"""

from __future__ import annotations

from math import hypot, sqrt

import numpy as np

from companion.avoidance.field.methods import Influence, Scene
from companion.config.planning import TangentialConfig, TurningSense
from companion.values.compiled import BOOL, FLOAT, VOID, array, kernel, output, part
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


@part
def _share(x: float) -> float:
    """Return ``x`` clipped to 0…1."""
    return min(max(x, 0.0), 1.0)


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
        config = self._config
        count = len(obstacles.ids)
        weight, away = np.empty(count), np.empty((count, 3))
        _weights(
            scene.position,
            scene.velocity,
            scene.to_go,
            np.ascontiguousarray(obstacles.positions),
            obstacles.d_safe,
            obstacles.radius,
            config.d_band,
            config.reach_s,
            config.d_full,
            self._dt,
            weight,
            away,
        )
        self._release(obstacles, weight)
        senses = self._senses(obstacles, weight, away, scene.to_go)
        if self._turning != "own" and config.wrong_side is not None:
            _fade_wrong_side(senses, away, scene.to_go, *config.wrong_side, weight)
        force = influence.force.copy()
        acts = _add(
            weight,
            senses,
            away,
            scene.to_go,
            scene.velocity,
            scene.destination_velocity,
            config.k_tang * sqrt(scene.gradient @ scene.gradient),
            self._u_max,
            config.force_max,
            config.pass_speed,
            force,
        )
        return Influence(force, config.omega_scale, influence.destination) if acts else influence

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
            return np.full(len(weight), 1.0 if self._turning == "right" else -1.0)
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

        It is the sense of the latched obstacle with the greatest weight. If none is latched, or if several of
        that weight disagree, the side of the course on which the weighted group lies decides.
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


@kernel(
    VOID,
    array(1),
    array(1),
    array(1),
    array(3),
    array(1),
    array(1),
    FLOAT,
    FLOAT,
    FLOAT,
    FLOAT,
    output(1),
    output(2),
)
def _weights(
    position: Array,
    velocity: Array,
    to_go: Array,
    positions: Array,
    d_safe: Array,
    radius: Array,
    d_band: float,
    reach_s: float,
    d_full: float,
    dt: float,
    weight: Array,
    away: Array,
) -> None:
    """Write to ``weight`` (M,) how much each obstacle's band acts, 0…1: the product of all its shares.

    ``away`` (M, 3), m, receives the vectors from the obstacles at ``positions`` (M, N + 1, 3) to the vehicle.
    ``radius`` is (M,) or (1,).
    """
    if len(d_safe) != len(positions) or (len(radius) != len(positions) and len(radius) != 1):
        raise ValueError("each obstacle needs a d_safe and a radius")
    length = sqrt(to_go[0] ** 2 + to_go[1] ** 2 + to_go[2] ** 2) + _NEAR
    arriving = _share((length - _THERE) / (_ON_THE_WAY - _THERE))
    for j in range(len(positions)):
        square = speed_square = approach = ahead = 0.0
        for i in range(3):
            off = position[i] - positions[j, 0, i]
            relative = (positions[j, 1, i] - positions[j, 0, i]) / dt - velocity[i]
            away[j, i] = off
            square += off * off
            speed_square += relative * relative
            approach += off * relative
            ahead -= off * to_go[i] / length
        distance = sqrt(square) + _NEAR
        full = d_full + radius[j % len(radius)]
        edge = d_safe[j] + d_band + reach_s * max(approach / distance, 0.0)
        depth = _share((edge - distance) / (edge - full))
        before = _share(1.0 + (length - ahead) / d_safe[j])
        # The closest approach at constant velocities.
        time = min(max(approach / (speed_square + _SLOW**2), 0.0), _SOON)
        miss = sqrt(max(square - time * (2.0 * approach - time * speed_square), 0.0))
        meeting = _share((d_safe[j] - miss) / (d_safe[j] - full))
        # An obstacle straight above or below has no horizontal passing direction.
        level = _share(_STEEP * (hypot(away[j, 0], away[j, 1]) + _NEAR) / distance)
        weight[j] = depth * _share(ahead / (_COSINE_FULL * distance)) * before * arriving * meeting * level


@kernel(VOID, array(1), array(2), array(1), FLOAT, FLOAT, output(1))
def _fade_wrong_side(
    senses: Array, away: Array, to_go: Array, whole: float, zero: float, weight: Array
) -> None:
    """Lower the ``weight`` (M,) of obstacles on the side on which a common turning sense does not pass them.

    There the force points away from the destination. It falls from 1 at the sine ``whole`` of the bearing to
    0 at the sine ``zero``. ``away`` (M, 3), m, leads from the obstacles to the vehicle.
    """
    length = sqrt(to_go[0] ** 2 + to_go[1] ** 2 + to_go[2] ** 2) + _NEAR
    for j in range(len(weight)):
        flat = hypot(away[j, 0], away[j, 1]) + _NEAR
        sine = senses[j] * (away[j, 0] * to_go[1] - away[j, 1] * to_go[0]) / (flat * length)
        weight[j] *= _share((sine + zero) / (zero - whole))


@kernel(
    BOOL, array(1), array(1), array(2), array(1), array(1), array(1), FLOAT, FLOAT, FLOAT, FLOAT, output(2)
)
def _add(
    weight: Array,
    senses: Array,
    away: Array,
    to_go: Array,
    velocity: Array,
    destination_velocity: Array,
    pull: float,
    u_max: float,
    force_max: float,
    pass_speed: float,
    force: Array,
) -> bool:
    """Add F_tang, eq. (18), to ``force`` (N + 1, 3); return whether there is any.

    ``pull`` is k_tang ‖∇J‖ of eq. (16).
    """
    x = y = 0.0
    for j in range(len(weight)):
        # α̂ = ± ẑ × α is horizontal: the force does not change the height.
        signed = weight[j] * senses[j] / (hypot(away[j, 0], away[j, 1]) + _NEAR)
        x -= signed * away[j, 1]
        y += signed * away[j, 0]
    norm = hypot(x, y)
    if norm < _NEAR:
        return False
    x, y = x / norm, y / norm
    whole = min(norm, 1.0)
    strength = min(pull, u_max * min(1.0, _QUICK * whole) + (force_max - u_max) * whole)
    # The force fades with the speed along it: whole up to half of ``most``, zero from ``most`` on. From that
    # speed half of u_max stops within the distance to the destination.
    sideways = (velocity[0] - destination_velocity[0]) * x + (velocity[1] - destination_velocity[1]) * y
    length = sqrt(to_go[0] ** 2 + to_go[1] ** 2 + to_go[2] ** 2)
    most = min(pass_speed, sqrt(u_max * length) + _NEAR)
    strength *= _share(2.0 * (1.0 - sideways / most))
    for n in range(len(force)):
        force[n, 0] += x * strength
        force[n, 1] += y * strength
    return True


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
