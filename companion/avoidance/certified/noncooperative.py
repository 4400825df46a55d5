"""Non-cooperative vehicles: balls that hold them, and the paper's field around them.

Planes keep plans clear of the balls; the field acts in the cost of the plan. Inside the least distance the
planes keep only the present distance: they do not drive the vehicle away from another that comes nearer by
itself. The field does, as far as other plans leave room.
"""

from __future__ import annotations

from collections.abc import Set
from math import inf
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.margins import between, margin, reachable
from companion.avoidance.field.forces import repulsion
from companion.config import CompanionConfig
from companion.config.obstacles import MovingPost
from companion.estimation.turn_rate import turning_path
from companion.obstacles.static import Axes
from companion.values.horizon import Array
from companion.values.obstacles import Obstacles
from companion.values.vectors import limit
from companion.world import View, World

_MAX_FORCE_FACTOR = 20.0
"""Clamp of the force of one obstacle, as a multiple of a_total.

The sum of the forces is limited to a_total itself (see ``companion.avoidance.field.planner``).
"""


class NonCooperativeVehicle(NamedTuple):
    """Non-cooperative vehicle as last received.

    ``position`` (3,), m; ``velocity`` (3,), m/s; ``age``: time from its last message to the next epoch, s;
    ``least``: least distance (m) from it; ``upright``: heights do not count; ``turn_rate``: rad/s,
    counter-clockwise from above.
    """

    position: Array
    velocity: Array
    age: float
    least: float
    upright: bool
    turn_rate: float = 0.0


class NonCooperative:
    """Non-cooperative vehicles around one vehicle, on the ``steps`` knots of its plans."""

    def __init__(self, config: CompanionConfig, steps: int) -> None:
        self._config, self._steps = config, steps
        self._turns = config.neighbour.sigma_turn > 0.0
        own = config.certified
        self._least_to_vehicle = between(own, config.field, config.limits)
        away = margin(own, config.field, config.limits)
        self._least_distance = exact = config.field.d_min + away
        # The reported position of a moving obstacle is assumed to be exact.
        self._moving_obstacles = {
            one.system: (exact + one.radius, isinstance(one, MovingPost)) for one in config.moving
        }
        self._target = None if config.target_d_min is None else config.target_d_min + away
        self._heights = 1.0 / config.field.downwash
        self._seconds: Array = 1e-6 * own.dt_us * np.arange(steps + 1.0)

    def seen(self, begins: int, members: Set[int], world: World) -> list[NonCooperativeVehicle]:
        """Return all received vehicles except ``members``, with their ages at ``begins`` (µs).

        A vehicle whose last message seems late is there twice: as it was by its clock, and as the message
        says, as if that had just been sent. Its clock may have begun anew.
        """
        found = []
        neighbours = world.neighbours
        rates = neighbours.turn_rates() if self._turns else {}
        received = [(*one, rates.get(one[0], 0.0)) for one in neighbours.last_received(members)]
        # The rate is that of the track, which such a message may not belong to.
        received += [(*one, 0.0) for one in neighbours.as_arrived()]
        for system, time, position, velocity, rate in received:
            if system not in members:
                age = max(1e-6 * (begins - time), 0.0)
                found.append(
                    NonCooperativeVehicle(
                        position,
                        velocity,
                        age,
                        *self._moving_obstacles.get(system, (self._least_to_vehicle, False)),
                        rate,
                    )
                )
        return found

    def balls(self, seen: list[NonCooperativeVehicle], own: Array) -> list[tuple[Array, Array]]:
        """Return centres (n, 3, 3) and least distances (n,) from them, m, for the vehicles ``seen``.

        ``own`` (n, 3, 3), m, are the control points of the own plan.
        """
        certified = self._config.certified
        growth = certified.noncooperative_growth_us
        bounds = (
            certified.noncooperative_speed,
            certified.noncooperative_acceleration,
            inf if growth is None else 1e-6 * growth,
        )
        found = []
        for one in seen:
            centres, reach = reachable(
                one.position, one.velocity, one.age, self._seconds, *bounds, one.turn_rate
            )
            radii = reach + one.least
            if one.upright:
                centres[..., 2] = own[..., 2]
            _stop_before_own_plan(centres, own, radii, self._heights)
            if one.upright:
                centres[..., 2] = own[..., 2]
            found.append((centres, radii))
        return found

    def target(self, now: int, begins: int, view: View) -> list[tuple[Array, Array]]:
        """Return centres and least distances, as ``balls`` does, for the target if it is an obstacle.

        ``view`` is that of ``now`` (µs); the epoch begins at ``begins`` (µs). The target is assumed to keep
        its speed and turn rate, so the least distance from it does not grow with time. A target that falls
        silent stays at its last extrapolated position.
        """
        if view.target_last is None or self._target is None:
            return []
        ends = view.target_last.ahead(self._seconds + 1e-6 * (begins - now)).positions
        middle = 0.5 * (ends[:-1] + ends[1:])
        return [(np.stack([ends[:-1], middle, ends[1:]], axis=1), np.full(self._steps, self._target))]

    def field(self, seen: list[NonCooperativeVehicle], own: Array, sensed: Axes | None = None) -> Array:
        """Return f (n, 3), m/s², after each step of the committed plan ``own`` (n, 3, 3): eqs. (9) and (10).

        It is the field of the vehicles ``seen``, assumed to keep their velocity, or to turn on, until they
        are near the plan, and of the obstacles ``sensed`` near the plan's control points.
        """
        config = self._config
        if sensed is None:
            sensed = Axes((), np.empty((0, 3 * self._steps, 3)), np.empty(0))
        if not seen and not sensed.ids:
            return np.zeros((self._steps, 3))
        knots = np.concatenate([own[:, 0], own[-1:, 2]])
        places = sensed.positions.reshape(-1, self._steps, 3, 3)
        there = np.concatenate([places[:, :, 0], places[:, -1:, 2]], axis=1)
        least = self._least_distance + sensed.radius
        if seen:
            flown = np.stack(
                [
                    turning_path(one.position, one.velocity, one.turn_rate, one.age + self._seconds).positions
                    for one in seen
                ]
            )
            for place, one in zip(flown, seen, strict=True):
                if one.upright:
                    place[:, 2] = knots[:, 2]
            enough = np.array([one.least for one in seen])
            off = (knots - flown) * (1.0, 1.0, self._heights)
            _stop_when_near(flown, np.linalg.norm(off, axis=-1), enough)
            there, least = np.concatenate([flown, there]), np.concatenate([enough, least])
        safe = least + config.field.d_safe - config.field.d_min
        heights = np.ones(len(there))
        heights[: len(seen)] = self._heights
        obstacles = Obstacles(tuple(range(len(there))), there, least, safe, heights=heights)
        clamp, dt = _MAX_FORCE_FACTOR * config.limits.a_total, 1e-6 * config.certified.dt_us
        force = repulsion(knots, obstacles, config.field.gain, clamp, config.field.braking, dt)
        return limit(force, config.limits.a_total)[1:]


def _stop_before_own_plan(centres: Array, own: Array, radii: Array, heights: float) -> None:
    """Stop a ball before the first segment at which the own plan is inside it.

    Differences in height are multiplied by ``heights``.

    From there on nothing can be guaranteed. A ball that moved on past the own plan would keep the vehicle
    from flying away from it.
    """
    off = (own - centres) * (1.0, 1.0, heights)
    caught = (np.vecdot(off, off) < radii[:, None] ** 2).any(axis=1)
    if caught.any():
        first = int(caught.argmax())
        centres[first:] = centres[first - 1, 2] if first else centres[0, 0]


def _stop_when_near(places: Array, distance: Array, least: Array) -> None:
    """Hold each of ``places`` (M, n, 3) where its ``distance`` (M, n) first reaches ``least`` (M,).

    If it never does, hold it where the distance is smallest. A place that had passed through the own plan
    would repel the vehicle towards the approaching one.
    """
    for place, far, enough in zip(places, distance, least, strict=True):
        near = int(np.argmax(far <= enough)) if (far <= enough).any() else int(far.argmin())
        place[near:] = place[near]
