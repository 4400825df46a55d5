"""Non-cooperative vehicles: balls that hold them, and the paper's field around them.

Planes keep clear of the balls; a plan yields to the field where it can. The planes ask for no more distance
than there is: they do not drive the vehicle away from one that comes nearer by itself. The field does, as far
as other plans leave room.
"""

from __future__ import annotations

from collections.abc import Set
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.margins import between, margin, reachable
from companion.avoidance.field.forces import repulsion
from companion.config import CompanionConfig
from companion.config.obstacles import MovingPost
from companion.obstacles.static import Axes
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles
from companion.values.vectors import limit
from companion.world import View, World

_NEAREST_COUNTS = 20.0
"""Clamp of one force, as a multiple of a_total.

The sum of the field is limited, not its parts (see ``companion.avoidance.field.planner``).
"""


class NonCooperativeVehicle(NamedTuple):
    """Non-cooperative vehicle as last received.

    Its ``position`` (3,), m, and ``velocity`` (3,), m/s; ``age``: time from then to the next epoch, s;
    ``least``: least distance (m) from it; ``upright``: heights do not count.
    """

    position: Array
    velocity: Array
    age: float
    least: float
    upright: bool


class NonCooperative:
    """Non-cooperative vehicles around one vehicle, on the ``steps`` knots of its plans."""

    def __init__(self, config: CompanionConfig, steps: int) -> None:
        self._config, self._steps = config, steps
        own = config.certified
        self._vehicle = between(own, config.field, config.limits)
        away = margin(own, config.field, config.limits)
        self._exact = exact = config.field.d_min + away
        # The reported position of a moving obstacle counts as exact.
        self._things = {
            one.system: (exact + one.radius, isinstance(one, MovingPost)) for one in config.moving
        }
        self._target = None if config.target_d_min is None else config.target_d_min + away
        self._seconds: Array = 1e-6 * own.dt_us * np.arange(steps + 1.0)

    def seen(self, begins: int, members: Set[int], world: World) -> list[NonCooperativeVehicle]:
        """Return the received vehicles except ``members``, for the epoch that begins at ``begins`` (µs)."""
        found = []
        for system, time, position, velocity in world.neighbours.last_received():
            if system not in members:
                age = max(1e-6 * (begins - time), 0.0)
                found.append(
                    NonCooperativeVehicle(
                        position, velocity, age, *self._things.get(system, (self._vehicle, False))
                    )
                )
        return found

    def balls(self, seen: list[NonCooperativeVehicle], own: Array) -> list[tuple[Array, Array]]:
        """Return centres (n, 3, 3) and least distances (n,) from them, m, for the vehicles ``seen``.

        ``own`` (n, 3, 3), m, are the control points of the own plan.
        """
        bounds = (
            self._config.certified.noncooperative_speed,
            self._config.certified.noncooperative_acceleration,
        )
        found = []
        for one in seen:
            centres, reach = reachable(one.position, one.velocity, one.age, self._seconds, *bounds)
            radii = reach + one.least
            if one.upright:
                centres[..., 2] = own[..., 2]
            _hold_where_caught(centres, own, radii)
            if one.upright:
                centres[..., 2] = own[..., 2]
            found.append((centres, radii))
        return found

    def target(self, now: int, begins: int, view: View) -> list[tuple[Array, Array]]:
        """Return the same for the target, where it is an obstacle, as seen at ``now`` (µs).

        It is for the epoch that begins at ``begins`` (µs). The target is assumed to keep its motion, because
        it is followed and not guarded against. One that falls silent stays where it was last.
        """
        if view.target_last is None or self._target is None:
            return []
        ends = view.target_last.ahead(self._seconds + 1e-6 * (begins - now)).positions
        middle = 0.5 * (ends[:-1] + ends[1:])
        return [(np.stack([ends[:-1], middle, ends[1:]], axis=1), np.full(self._steps, self._target))]

    def field(self, seen: list[NonCooperativeVehicle], own: Array, sensed: Axes | None = None) -> Array:
        """Return f (n, 3), m/s², after each step of the committed plan ``own`` (n, 3, 3): eqs. (9) and (10).

        It is the field of those ``seen``, which keep their velocity until they are near, and of what is
        ``sensed`` beside the plan's control points.
        """
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
    """Hold a ball from where it has grown over the plan, on the side that it came from.

    There nothing is guaranteed, whatever the plane. Beyond the vehicle the ball would keep it from flying
    away.
    """
    off = own - centres
    caught = (np.vecdot(off, off) < radii[:, None] ** 2).any(axis=1)
    if caught.any():
        first = int(caught.argmax())
        centres[first:] = centres[first - 1, 2] if first else centres[0, 0]


def _stop_when_near(places: Array, distance: Array, least: Array) -> None:
    """Hold each of ``places`` (M, n, 3) where its ``distance`` (M, n) first reaches ``least`` (M,).

    If it never does, hold it where the distance is smallest. A place that has passed through the vehicle
    would drive it back into the way of what is yet to come.
    """
    for place, far, enough in zip(places, distance, least, strict=True):
        near = int(np.argmax(far <= enough)) if (far <= enough).any() else int(far.argmin())
        place[near:] = place[near]
