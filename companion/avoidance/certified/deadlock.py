"""Deadlock turn: resolves deadlocks in which plans certify each other.

A deadlock begins at the rest points, where the plans end, before the vehicles themselves stop. For example,
vehicles meet in the middle: after a second their rest points lie on a small circle, the planes let each rest
point move outward only, and the plan that stays is optimal. If a vehicle's planes push its plan back while
its rest point makes no progress, the goal is turned aside about the vehicle, for all vehicles to the same
side, and back again when the push is gone, or when it brought no progress and the line to the goal is free.
The turn changes only the cost, and depends only on the vehicle's own solutions. The constraints that certify
separation do not change.

The push is F = Σ λ c, the sum of the planes' normals c times the multipliers λ of their rows. The blocking is
b = clip(−F·d / (G · L), 0, 1) · clip(1 − v_L/v, 0, 1). d and L are the direction and the distance of the goal
from the rest point, G is the gradient of the cost per metre of error, v_L the speed at which L falls, and v
the setting ``deadlock.speed``. If b exceeds ``deadlock.pushed`` the turn grows at a rate proportional to b;
otherwise it decreases. Pushes of vehicles that fly to the side of the turn and ahead do not count: a vehicle
that turned with them would pass them on the far side, with the goal on the near one.
"""

from __future__ import annotations

from math import dist, pi, sqrt
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.separating_planes import AGREED, Others
from companion.config.certified import DeadlockConfig
from companion.values.bearings import rotated, turned
from companion.values.compiled import FLOAT, VOID, array, kernel, output, several
from companion.values.horizon import Array

Vector = tuple[float, float, float]

_MIN_PULL_DISTANCE_M = 0.5
"""Distance of the goal below which the pull of the cost counts as constant."""
_MIN_GAIN_M = 0.05
_REACHED_M = 0.1
"""Progress: the rest point is nearer to the goal than ``_REACHED_M``, or ``_MIN_GAIN_M`` nearer than ever."""
_STANDS_S, _STANDS_M = 1.0, 0.25
"""Time (s) for which the rest point stays within a distance (m) of one place before the plan stands."""
_IN_VAIN_S = 5.0
"""Time (s) without progress after the turn may be ``bend_more``, after which it is given up."""


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
        self._stood_at: Array | None = None
        self._stood = 0.0

    def turned(self, position: Array, goal: Array, least: float = 0.0) -> Array:
        """Return the place (3,), m, to aim for from ``position`` (3,) instead of ``goal`` (3,).

        The goal is turned by ``least`` (rad) at least. On a turn above ``bend`` it is at most ``detour`` (m)
        away.
        """
        angle = max(self.angle, least)
        if angle == 0.0:
            return goal
        offset = goal - position
        if angle > self._config.bend:
            length = sqrt(offset @ offset)
            if length > self._config.detour:
                offset = offset * (self._config.detour / length)
        return position + turned(offset, -self._sense * angle)

    @property
    def overtime(self) -> bool:
        """Whether there was no progress for longer than ``patience``."""
        return self._waited > self._config.patience

    @property
    def stalled(self) -> bool:
        """Whether there was no progress although the goal was turned by ``bend_more``."""
        return self._waited > self._full_after

    @property
    def stands(self) -> bool:
        """Whether the rest point has stayed at one place for some time, and that is not the goal."""
        return self._stood >= _STANDS_S

    @property
    def _full_after(self) -> float:
        """Time (s) without progress after which the turn may be ``bend_more``."""
        config = self._config
        return config.patience + (config.bend_more - config.bend) / config.slow

    def give_up(self) -> None:
        """End the turn and measure progress anew, if there was none for ``_IN_VAIN_S`` after it was full.

        For a free line to the goal: vehicles that rest behind may push the plan back from the turned goal for
        ever.
        """
        if self._waited > self._full_after + _IN_VAIN_S:
            self.angle = self._waited = 0.0
            self.restart()

    def restart(self) -> None:
        """Measure progress anew, because the way to the goal is another one."""
        self._distance, self._best = None, np.inf
        self._stood_at, self._stood = None, 0.0

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
        it then does not measure progress, the turn stays below ``bend``, and the plan never stands.
        """
        config = self._config
        x, y, z = (goal - rest).tolist()
        direct = sqrt(x * x + y * y + z * z)
        distance = direct + beyond
        approach_speed = np.inf if self._distance is None else (self._distance - distance) / seconds
        self._distance = distance
        if moving:
            self._best, self._waited = np.inf, 0.0
        elif distance < self._best - _MIN_GAIN_M or distance < _REACHED_M:
            self._best, self._waited = min(distance, self._best), 0.0
        else:
            self._waited += seconds
        if (
            moving
            or distance < _REACHED_M
            or self._stood_at is None
            or dist(rest, self._stood_at) > _STANDS_M
        ):
            self._stood_at, self._stood = rest.copy(), 0.0
        else:
            self._stood += seconds
        overtime = max(0.0, self._waited - config.patience)
        least = max(direct, 1e-6)
        direction = x / least, y / least, z / least
        # Without a side no push is left out.
        aside = (0.0, 0.0, 0.0) if moving else rotated(direction, -self._sense * 0.5 * pi)
        push = _counted(*pushes, direction, aside, config.chase)
        push_back = -_dot(push, direction)
        if overtime > 0.0:
            # After ``patience`` without progress, a push back along the turned direction counts, too.
            push_back = max(push_back, -_dot(push, rotated(direction, -self._sense * self.angle)))
        pushed = min(max(push_back / (gradient_per_metre * max(direct, _MIN_PULL_DISTANCE_M)), 0.0), 1.0)
        pushed *= min(max(1.0 - approach_speed / config.speed, 0.0), 1.0)
        if pushed > config.pushed:
            most = min(config.bend_more, config.bend + config.slow * overtime)
            self.angle = min(most, self.angle + config.up * seconds * pushed)
        else:
            self.angle = max(0.0, self.angle - config.down * seconds / (1.0 + overtime))


def mean_velocities(others: Others, seconds: float, count: int) -> Array:
    """Return the mean velocities (count, 3), m/s, of plans of ``seconds``; zero for those without a plan.

    The first are those of the agreements and pairs of ``others``, of which there are ``count`` at most.
    """
    found = np.zeros((count, 3))
    agreed = np.empty((0, 1, AGREED)) if others.agreed is None else others.agreed
    _mean_velocities(agreed, np.ascontiguousarray(others.controls), seconds, found)
    return found


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel(VOID, array(3), array(4), FLOAT, output(2))
def _mean_velocities(agreed: Array, controls: Array, seconds: float, found: Array) -> None:
    count, last = len(agreed), controls.shape[1] - 1
    for m in range(count):
        for axis in range(9, 12):
            found[m, axis - 9] = (agreed[m, agreed.shape[1] - 1, axis] - agreed[m, 0, axis]) / seconds
    for m in range(len(controls)):
        for axis in range(3):
            found[count + m, axis] = (controls[m, last, 2, axis] - controls[m, 0, 0, axis]) / seconds


@kernel(several(3), array(2), array(2), several(3), several(3), FLOAT)
def _counted(forces: Array, velocities: Array, direction: Vector, aside: Vector, chase: float) -> Vector:
    """Return the force that the turn answers, for a goal in ``direction``, with the turn to ``aside``.

    A vehicle that crosses to the side of the turn, and flies in about this direction as well, stays beside a
    vehicle that turns: its push does not count.
    """
    x = y = z = 0.0
    for m in range(len(forces)):
        beside = ahead = 0.0
        for axis in range(3):
            beside += velocities[m, axis] / chase * aside[axis]
            ahead += velocities[m, axis] / chase * direction[axis]
        counts = 1.0 - min(max(beside, 0.0), 1.0) * min(max(ahead, 0.0), 1.0)
        x += counts * forces[m, 0]
        y += counts * forces[m, 1]
        z += counts * forces[m, 2]
    return x, y, z
