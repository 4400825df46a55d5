"""World picture of a planner whose caller gives positions: what ``companion.world.World`` is for messages."""

from __future__ import annotations

from collections.abc import Sequence, Set

import numpy as np

from companion.config import CompanionConfig
from companion.estimation.tracks import State
from companion.obstacles.static import Axes, FixedObstacles
from companion.values.horizon import Array
from companion.values.mates import Mates, Sight
from companion.values.obstacles import Obstacles
from companion.world import View, reach
from mavlink_bridge.frames import LocalFrame
from outrider.planner.own_parts import TARGET
from outrider.planner.values import Neighbour, Obstacle, Target, microseconds

_FIRST_OBSTACLE_ID = 1_000_000
"""Ids of the caller's obstacles begin here: above those of configured ones."""
_MAX_PLAN_DEVIATION_M = 1.0
"""A neighbour further than this (m) from its plan is not predicted by it, as in ``companion.obstacles``."""
_NO_POSITIONS = np.empty((0, 3))
_NO_POSITIONS.flags.writeable = False


class Surroundings:
    """Own state, target, neighbours and obstacles of the present step.

    ``neighbours`` and ``sensed`` are the object itself: it has those methods of ``World``, ``Neighbours`` and
    ``Sensed`` that planning calls.
    """

    def __init__(self, config: CompanionConfig, local: LocalFrame) -> None:
        self._config, self._local = config, local
        self._fixed = FixedObstacles(config.obstacles)
        self._reach = reach(config)
        self._steps, self._dt = config.horizon.steps + 1, config.horizon.dt_us
        self._now = 0
        self._neighbours: tuple[Neighbour, ...] = ()
        self._obstacles: tuple[Obstacle, ...] = ()
        self._places = self._velocities = _NO_POSITIONS
        self._radii: Array = np.empty(0)
        self.neighbours = self.sensed = self
        self.below = 0

    def take(
        self,
        now: int,
        own: tuple[Array, Array, float],
        target: Target | None,
        neighbours: Sequence[Neighbour],
        obstacles: Sequence[Obstacle],
    ) -> View:
        """Take what is known at ``now`` (µs): own position, velocity, yaw, and the rest; return the view."""
        self._now, self._neighbours, self._obstacles = now, tuple(neighbours), tuple(obstacles)
        self._places = np.array([one.position for one in obstacles], dtype=np.float64).reshape(-1, 3)
        self._velocities = np.array([one.velocity for one in obstacles], dtype=np.float64).reshape(-1, 3)
        self._radii = np.array([one.radius for one in obstacles], dtype=np.float64)
        position, velocity, yaw = own
        seen = None
        if target is not None:
            seen = State(np.asarray(target.position), np.asarray(target.velocity), 0, 0.0, target.turn_rate)
        return View(State(position, velocity, 0, 0.0), yaw, seen, self._local, seen)

    def obstacles(self, now: int, view: View, prediction: Array) -> Obstacles:
        """Return all obstacles, aligned with ``now + n·dt``, as ``World.obstacles`` does."""
        config, field = self._config, self._config.field
        found = self._of_neighbours(now)
        target = view.target_last
        if target is not None and config.target_d_min is not None and config.target_d_safe is not None:
            margin = np.array([field.margin(2)])
            ahead: Array = 1e-6 * self._dt * np.arange(float(self._steps))
            places = target.ahead(ahead).positions[None]
            found = found.joined(
                Obstacles(
                    (TARGET,), places, config.target_d_min + margin, config.target_d_safe + margin, margin
                )
            )
        if len(self._fixed):
            found = found.joined(self._enlarged(self._fixed.around(prediction, self._reach)))
        if self._obstacles:
            seconds: Array = 1e-6 * (now - self._now + self._dt * np.arange(float(self._steps)))
            found = found.joined(self._enlarged(self._near(seconds, prediction, self._reach)))
        return found

    def around(self, now: int, prediction: Array, reach: float) -> Axes:
        """Return the caller's obstacles near the control points (3 n, 3), m, of a committed plan.

        The plan begins one epoch after ``now`` (µs), and has n segments of three control points.
        """
        certified, count = self._config.certified, len(prediction) // 3
        halves = (np.arange(float(count))[:, None] + 0.5 * np.arange(3.0)).ravel()
        seconds: Array = 1e-6 * (now + certified.epoch_us - self._now + certified.dt_us * halves)
        return self._near(seconds, prediction, reach)

    def last_received(self, without: Set[int] = frozenset()) -> list[tuple[int, int, Array, Array]]:
        """Return id, time (µs), position (3,) and velocity (3,) of the neighbours not in ``without``."""
        return [
            (one.id, self._time_of(one), np.asarray(one.position), np.asarray(one.velocity))
            for one in self._neighbours
            if one.id not in without
        ]

    def as_arrived(self) -> list[tuple[int, int, Array, Array]]:
        """Return nothing: the caller says when each neighbour was where, so no date is in doubt."""
        return []

    def turn_rates(self) -> dict[int, float]:
        """Return nothing: the caller gives no turn rates of neighbours."""
        return {}

    def bounds(self, _now: int, _place: Array) -> None:
        """Return None: the caller says where the neighbours are, so none is unheard."""

    def mates(self, now: int) -> Mates:
        """Return the neighbours that share a plan which is not too old."""
        found = self._planning(now)
        places = np.array([self._here(one, now) for one in found]).reshape(-1, 3)
        return Mates(tuple(one.id for one in found), places)

    def sight(self, now: int, ahead: float) -> Sight:
        """Return nothing: the caller gives the target's state, not detections."""
        return Sight()

    def mate_ids(self, now: int) -> frozenset[int]:
        """Return the ids of the neighbours that share a plan which is not too old."""
        return frozenset(one.id for one in self._planning(now))

    def _planning(self, now: int) -> list[Neighbour]:
        """Return the neighbours with a plan that is not older than ``guard.plan_stale_us``."""
        oldest = now - self._config.guard.plan_stale_us
        return [one for one in self._neighbours if one.plan is not None and one.plan.horizon.epoch >= oldest]

    def _time_of(self, neighbour: Neighbour) -> int:
        return self._now if neighbour.time is None else microseconds("time", neighbour.time)

    def _here(self, neighbour: Neighbour, now: int) -> Array:
        """Return where ``neighbour`` is at ``now`` (µs): extrapolated for a bounded time."""
        age = min(max(now - self._time_of(neighbour), 0), self._config.neighbour.extrapolate_us)
        return np.asarray(np.asarray(neighbour.position) + 1e-6 * age * np.asarray(neighbour.velocity))

    def _of_neighbours(self, now: int) -> Obstacles:
        """Return the neighbours: along their plans, or at constant velocity."""
        field, others = self._config.field, self._neighbours
        positions = np.empty((len(others), self._steps, 3))
        seconds: Array = 1e-6 * self._dt * np.arange(float(self._steps))
        fresh = self.mate_ids(now)
        for row, one in zip(positions, others, strict=True):
            here = self._here(one, now)
            if one.plan is not None and one.id in fresh:
                planned = one.plan.horizon.positions(now, self._steps, self._dt)
                if np.linalg.norm(planned[0] - here) <= _MAX_PLAN_DEVIATION_M:
                    row[:] = planned
                    continue
            row[:] = here
            if now - self._time_of(one) <= self._config.neighbour.extrapolate_us:
                row += seconds[:, None] * np.asarray(one.velocity)
        margin = np.full(len(others), field.margin(2))
        ids = tuple(one.id for one in others)
        return Obstacles(ids, positions, field.d_min + margin, field.d_safe + margin, margin)

    def _near(self, seconds: Array, prediction: Array, reach: float) -> Axes:
        """Return the caller's obstacles after ``seconds`` (n,) that come within ``reach`` (m)."""
        places = self._places[:, None] + seconds[:, None] * self._velocities[:, None]
        for index, one in enumerate(self._obstacles):
            if one.upright:
                places[index, :, 2] = prediction[:, 2]
        off = np.linalg.norm(places - prediction, axis=-1).min(axis=1, initial=np.inf)
        near = np.flatnonzero(off <= reach + self._radii)
        ids = tuple((near + _FIRST_OBSTACLE_ID).tolist())
        return Axes(ids, places[near], self._radii[near])

    def _enlarged(self, axes: Axes) -> Obstacles:
        """Return obstacles that stand in the way by their own size and the margin of the own position."""
        field = self._config.field
        radius = axes.radius + field.margin(1)
        return Obstacles(axes.ids, axes.positions, field.d_min + radius, field.d_safe + radius, radius)
