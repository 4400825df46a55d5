"""Those that share no plan: balls that hold them, which planes keep clear of, and the paper's field of them,
which a plan would rather yield to.

The planes ask for no more than is there: from one that comes nearer by itself they do not drive away. The
field does, as far as other plans leave room.
"""

from __future__ import annotations

from collections.abc import Set
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.margins import between, margin, stranger
from companion.avoidance.field.forces import repulsion
from companion.config import CompanionConfig
from companion.config.obstacles import MovingPost
from companion.obstacles.static import Axes
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles
from companion.values.vectors import limit
from companion.world import View, World

_NEAREST_COUNTS = 20.0
"""The sum of the field is limited, not its parts (see ``companion.avoidance.field.planner``)."""


class Stranger(NamedTuple):
    """Where it was, (3,) m, its velocity (3,) m/s, how long before the next epoch that was, s, the least
    distance (m) from it, and whether heights do not count."""

    position: Array
    velocity: Array
    age: float
    least: float
    upright: bool


class NonCooperative:
    """Of one vehicle, on its plans' ``steps`` knots."""

    def __init__(self, config: CompanionConfig, steps: int) -> None:
        self._config, self._steps = config, steps
        own = config.certified
        self._vehicle = between(own, config.field, config.limits)
        away = margin(own, config.field, config.limits)
        self._exact = exact = config.field.d_min + away
        # Where such a thing says that it is counts as exact.
        self._things = {
            one.system: (exact + one.radius, isinstance(one, MovingPost)) for one in config.moving
        }
        self._target = None if config.target_d_min is None else config.target_d_min + away
        self._seconds: Array = 1e-6 * own.dt_us * np.arange(steps + 1.0)

    def seen(self, begins: int, members: Set[int], world: World) -> list[Stranger]:
        """All but the ``members`` that are heard, for the epoch that begins at ``begins`` (µs)."""
        found = []
        for system, time, position, velocity in world.neighbours.last_heard():
            if system not in members:
                age = max(1e-6 * (begins - time), 0.0)
                found.append(
                    Stranger(position, velocity, age, *self._things.get(system, (self._vehicle, False)))
                )
        return found

    def balls(self, seen: list[Stranger], own: Array) -> list[tuple[Array, Array]]:
        """Centres (n, 3, 3) and least distances (n,) from them, m, beside control points ``own`` (n, 3,
        3)."""
        bounds = self._config.certified.stranger_speed, self._config.certified.stranger_acceleration
        found = []
        for one in seen:
            centres, reach = stranger(one.position, one.velocity, one.age, self._seconds, *bounds)
            radii = reach + one.least
            if one.upright:
                centres[..., 2] = own[..., 2]
            _hold_where_caught(centres, own, radii)
            if one.upright:
                centres[..., 2] = own[..., 2]
            found.append((centres, radii))
        return found

    def target(self, now: int, begins: int, view: View) -> list[tuple[Array, Array]]:
        """The same for the target, where it is an obstacle, as seen at ``now`` for the epoch that begins at
        ``begins`` (µs): that it flies on as it does is taken for granted, for it is followed and not guarded
        against. One that falls silent stays where it was last."""
        if view.target_last is None or self._target is None:
            return []
        ends = view.target_last.ahead(self._seconds + 1e-6 * (begins - now)).positions
        middle = 0.5 * (ends[:-1] + ends[1:])
        return [(np.stack([ends[:-1], middle, ends[1:]], axis=1), np.full(self._steps, self._target))]

    def field(self, seen: list[Stranger], own: Array, sensed: Axes | None = None) -> Array:
        """f (n, 3), m/s², after each step of the committed plan ``own`` (n, 3, 3): eqs. (8) and (9) for those
        that fly on as they do until they are near, and for what is ``sensed`` beside its control points."""
        config = self._config
        if sensed is None:
            sensed = Axes((), np.empty((0, 3 * self._steps, 3)), np.empty(0))
        if not seen and not sensed.ids:
            return np.zeros((self._steps, 3))
        knots = np.concatenate([own[:, 0], own[-1:, 2]])
        places = sensed.positions.reshape(-1, self._steps, 3, 3)
        there = np.concatenate([places[:, :, 0], places[:, -1:, 2]], axis=1)
        least = self._exact + sensed.radius
        if seen:
            fly = np.stack([one.position + (one.age + self._seconds)[:, None] * one.velocity for one in seen])
            for place, one in zip(fly, seen, strict=True):
                if one.upright:
                    place[:, 2] = knots[:, 2]
            enough = np.array([one.least for one in seen])
            _stop_when_near(fly, np.linalg.norm(knots - fly, axis=-1), enough)
            there, least = np.concatenate([fly, there]), np.concatenate([enough, least])
        safe = least + config.field.d_safe - config.field.d_min
        obstacles = Obstacles(tuple(range(len(there))), there, least, safe)
        clamp, dt = _NEAREST_COUNTS * config.limits.a_total, 1e-6 * config.certified.dt_us
        force = repulsion(knots, obstacles, config.field.gain, clamp, config.field.braking, dt)
        return limit(force, config.limits.a_total)[1:]


def _hold_where_caught(centres: Array, own: Array, radii: Array) -> None:
    """Where a ball has grown over the plan nothing is promised, whatever its plane: there it stays on the
    side that it came from, for beyond the vehicle it would keep that from flying away."""
    off = own - centres
    caught = (np.vecdot(off, off) < radii[:, None] ** 2).any(axis=1)
    if caught.any():
        first = int(caught.argmax())
        centres[first:] = centres[first - 1, 2] if first else centres[0, 0]


def _stop_when_near(places: Array, distance: Array, least: Array) -> None:
    """Hold each of ``places`` (M, n, 3) where its ``distance`` (M, n) first comes to ``least`` (M,), or is
    smallest: what has gone through the vehicle would drive it back into the way of what is yet to come."""
    for place, far, enough in zip(places, distance, least, strict=True):
        near = int(np.argmax(far <= enough)) if (far <= enough).any() else int(far.argmin())
        place[near:] = place[near]
