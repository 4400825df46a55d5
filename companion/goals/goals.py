"""Destination of a plan: the surface around the target, a goal, or a place to hold, land or return to."""

from __future__ import annotations

from math import hypot, inf
from typing import Protocol

import numpy as np

from companion.avoidance.field.planner import Aim, standing
from companion.config import CompanionConfig
from companion.config.formation import Perception, Spread
from companion.config.planning import LimitsConfig
from companion.estimation.tracks import State
from companion.estimation.turn_rate import Path
from companion.goals.formation import even_turn, outside, spacing, taking_part
from companion.goals.perception import PerceptionFormation
from companion.goals.roofs import Roofs
from companion.goals.settling import Settling
from companion.values.bearings import turned
from companion.values.horizon import Array, Motion
from companion.values.mates import Mates, Sight
from companion.values.obstacles import Obstacles
from companion.values.phase import UNDER_WAY, Phase
from companion.values.speed_bounds import SpeedBounds
from companion.ways import way_of
from companion.world import View

_RETURNED_WITHIN_M, _RETURNED_BELOW_M_S = 0.5, 0.5
"""Horizontal distance to the start, and speed, below which the vehicle is back above its start.

The distance is also the least decrease that counts as progress.
"""
_LANE_TOLERANCE_M, _NO_LANE_WITHIN_M = 1.0, 2.0
"""m. The lane of a returning vehicle is the height at which it flies to its start.

It sets off when it is at most the first value below its lane, or less than the second value horizontally from
its start.
"""
_BLOCKED_WITHIN_M, _NO_PROGRESS_TIMEOUT_US = 5.0, 10_000_000
"""A vehicle within this distance of its start that has come no nearer for this time is back, too."""

_NO_MATES, _NO_SIGHT = Mates(), Sight()


class Flight(Protocol):
    """State of the flight, as far as goals depend on it."""

    @property
    def phase(self) -> Phase:
        """Phase of the flight."""
        ...

    @property
    def start(self) -> Array | None:
        """Position (3,) before take-off, m, fleet-local ENU."""
        ...

    @property
    def planned_limits(self) -> LimitsConfig:
        """Limits that plans keep."""
        ...

    def returned(self) -> None:
        """Report that the vehicle is back above its start, or as near to it as it can get."""
        ...

    def settled(self) -> None:
        """Report that the vehicle hovers and may land."""
        ...


class Goals:
    """Destinations of the vehicle of ``system``.

    ``pilot`` gives the phase, and receives a report when the vehicle is back and when it has settled.
    ``lookahead_s``: time (s) from now to the end of a plan. ``target_system``: system id of the target.
    """

    def __init__(
        self, config: CompanionConfig, system: int, pilot: Flight, lookahead_s: float, target_system: int
    ) -> None:
        self._config = config
        self._unshared = {target_system, *(one.system for one in config.moving)}
        self._pilot = pilot
        self._lookahead_s = lookahead_s
        self._surface = config.surface_of(system)
        formation = config.formation
        self._perception = (
            PerceptionFormation(config, formation, system, lookahead_s)
            if isinstance(formation, Perception)
            else None
        )
        self._roofs = Roofs(config.obstacles)
        self._settling = Settling(config, self._unshared, self._roofs)
        self._phase: Phase | None = None
        self._held: Array | None = None
        self._began: Array | None = None
        self._nearest, self._nearer_at = inf, 0
        self._lane, self._clearance = 0.0, self._above_target(system)
        self._step = config.return_step
        limits = config.limits.within(config.field.margin(1))
        self._low, self._high = np.array(limits.box_min), np.array(limits.box_max)
        self._floor = -inf
        # Committed plans have their ways from the ends of plans on.
        least = config.field.d_min + config.field.margin(1)
        self._way = way_of(config, least) if config.avoidance == "field" else None
        self.goal: Array | None = None
        """Ordered goal (3,) of the task ``goto``, m, fleet-local ENU.

        None: the goal is the position where steering began.
        """

    @property
    def enclosed(self) -> bool:
        """Whether fixed obstacles leave no way to the destination, as far as goals have ways (field)."""
        return self._way is not None and self._way.enclosed

    def begin(self, position: Array) -> None:
        """Record that steering begins, for the first time or again, at ``position`` (3,), m."""
        self._began = position

    def forget(self, view: View) -> None:
        """Discard the state of an earlier phase.

        In an escort with a target, discard also the position held while there was no target.
        """
        phase = self._pilot.phase
        if phase is not self._phase:
            self._phase, self._held = phase, None
            limits = self._pilot.planned_limits
            config = self._config.model_copy(update={"limits": limits})
            self._settling = Settling(config, self._unshared, self._roofs)
            self._nearest = inf
            self._floor = limits.within(self._config.field.margin(1)).box_min[2]
            if self._way is not None:
                self._way.forget()
                self._way.keep_above(self._floor)
        elif phase is Phase.ESCORT and self._config.task == "escort" and view.target is not None:
            self._held = None

    def aim(
        self,
        now: int,
        view: View,
        measured: Motion,
        obstacles: Obstacles,
        mates: Mates = _NO_MATES,
        smaller_ids: int = 0,
        sight: Sight = _NO_SIGHT,
        bounds: SpeedBounds | None = None,
        *,
        cautious: bool,
    ) -> Aim:
        """Return the aim of a plan at ``now`` (µs) from ``measured`` on.

        ``cautious`` limits the distance to the destination to what ``guard.cautious_speed`` covers within a
        horizon. ``obstacles``: what settling keeps clear of. ``mates``: those that share the surface.
        ``smaller_ids``: how many neighbours have a smaller id. ``sight``: of the target.
        ``bounds``: on the speed at the measured position; they go with the aim, and limit its distance, too.
        Raises SurfaceError if the function of a user's surface fails.
        """
        self._lane = self._step * smaller_ids + self._clearance if self._step else 0.0
        aim = self._on_way(self._destination(now, view, measured, obstacles, mates, sight), measured)
        limit = self._config.guard.cautious_speed
        speed = inf if limit is None or not cautious else limit
        offset = aim.destination - (aim.target_end - aim.target) - measured.position
        if bounds is not None:
            aim, speed = aim._replace(bounds=bounds), min(speed, bounds.along(offset))
        return aim if speed == inf else self._shortened(aim, measured, speed)

    def _on_way(self, aim: Aim, measured: Motion) -> Aim:
        """Return the aim at the sub-goal of the way where fixed obstacles block the straight one."""
        if self._way is None or self._pilot.phase not in UNDER_WAY:
            return aim
        place = self._way.towards(measured.position, aim.destination).place
        if place is not aim.destination:
            aim = standing(place, aim.target)
        return aim._replace(clear=self._way.clear)

    def _shortened(self, aim: Aim, measured: Motion, speed: float) -> Aim:
        """Return the aim in the same direction, but no further than ``speed`` (m/s) covers in a horizon.

        The motion of the target within the horizon is added to this distance.
        """
        drift = aim.target_end - aim.target
        offset = aim.destination - drift - measured.position
        distance = float(np.linalg.norm(offset))
        longest = speed * 1e-6 * self._config.horizon.dt_us * (self._config.horizon.steps + 1)
        if distance <= longest:
            return aim
        return aim._replace(destination=measured.position + drift + longest / distance * offset)

    def _destination(
        self, now: int, view: View, measured: Motion, obstacles: Obstacles, mates: Mates, sight: Sight
    ) -> Aim:
        """Return the aim of the present phase and task, before ``cautious`` shortens it."""
        target, phase, task = view.target, self._pilot.phase, self._config.task
        given = False
        if phase is Phase.RETURN:
            place = self._way_back(now, measured)
        elif phase is Phase.SETTLE:
            place = self._settling.rest(now, measured, obstacles)
            if self._settling.clear:
                self._pilot.settled()
        elif phase is not Phase.HOLD and task == "goto":
            began = measured.position if self._began is None else self._began
            place = began if self.goal is None else self._above_floor(self.goal)
            given = self.goal is not None
        elif phase is not Phase.HOLD and target is not None:
            return self._around(now, target, measured, mates, sight)
        else:
            # Ordered to hold, or there is no target: hold the position.
            place = self._place_to_hold(measured)
        return standing(place, None if target is None else target.position)._replace(given=given)

    def _around(self, now: int, target: State, measured: Motion, mates: Mates, sight: Sight) -> Aim:
        """Return the aim on the surface around the target's position at the end of the horizon."""
        ahead, rate, surface = self._lookahead_s, self._config.turn_rate, self._surface
        here = measured.position - target.position
        turn, apart = self._turn(here, mates.positions - target.position)
        along = self._perception
        if along is not None:
            turn = along.turn(now, target.position, here, surface.nearest(here), mates, sight)
        first = surface.nearest(turned(here, turn) if turn else here)

        def around(positions: Array, velocities: Array, seconds: Array) -> Path:
            """Return the destination, where the target is at ``positions`` (n, 3) after ``seconds`` (n,)."""
            offsets = np.broadcast_to(first, positions.shape)
            if rate:
                offsets = surface.nearest(np.array([turned(first, rate * after) for after in seconds]))
                across = np.stack([-offsets[:, 1], offsets[:, 0], np.zeros(len(seconds))], axis=1)
                velocities = velocities + rate * across
            if along is not None:
                offsets = np.array([along.standoff(offset, target.sigma) for offset in offsets])
            elif turn:
                offsets = np.array([outside(offset, turn) for offset in offsets])
            return Path(positions + offsets, velocities)

        last = np.array([ahead])
        ends = target.ahead(last)
        (destination,), (velocity,) = around(*ends, last)

        def path(seconds: Array) -> Path:
            """Return the destination and its velocity after ``seconds`` (n,)."""
            return around(*target.ahead(seconds), seconds)

        return Aim(destination, velocity, target.position, ends.positions[0], surface, apart, path)

    def _turn(self, offset: Array, neighbours: Array) -> tuple[float, float]:
        """Return the angle (rad) by which to go round, and the spacing.

        ``offset`` (3,), m, is the vehicle's from the target. The angle leads towards the vehicle's place
        among ``neighbours`` (M, 3), also offsets from the target. The spacing (m) is the distance to keep
        from them, ∞ where the surface is not shared or a neighbour is too far away to take part.
        """
        formation = self._config.formation
        if not isinstance(formation, Spread) or not len(neighbours):
            return 0.0, inf
        here = self._surface.nearest(offset)
        others = taking_part(formation, neighbours, float(np.linalg.norm(here)))
        turn, apart = even_turn(offset, others), inf
        if 0 < len(others) == len(neighbours):
            apart = spacing(hypot(here[0], here[1]), len(others), turn)
        return max(-formation.turn, min(formation.turn, turn)), apart

    def _above_floor(self, place: Array) -> Array:
        """Return the ``place`` (3,), m, raised to the floor of plans if ``guard.least_height`` is set."""
        if self._config.guard.least_height is None or place[2] >= self._floor:
            return place
        return np.array([place[0], place[1], self._floor])

    def _place_to_hold(self, measured: Motion) -> Array:
        """Return the position (3,) at the order to hold or to return, or at the loss of the target."""
        if self._held is None:
            self._held = measured.position.copy()
        return self._held

    def _above_target(self, system: int) -> float:
        """Return the climb (m) from the surface's lowest point to where the target no longer repels.

        All lanes are raised by this climb, because the target could push a vehicle in a lower lane up into
        the lane above.
        """
        config = self._config
        if config.task != "escort" or config.target_d_safe is None:
            return 0.0
        lowest = float(config.surface_of(system).outline()[:, 2].min())
        return max(config.target_d_safe + config.field.margin(1) - lowest, 0.0)

    def _way_back(self, now: int, measured: Motion) -> Array:
        """Return the place (3,), m, to return to: above the start.

        Its height is the one at the order to return plus ``_lane``. The place is clipped to the box. A
        vehicle with a lane climbs to the lane first: lanes separate the vehicles only once they have been
        reached. The pilot receives a report when the vehicle is there, or when it is near and comes no
        nearer.
        """
        start = self._pilot.start
        if start is None:
            return measured.position
        held = self._place_to_hold(measured)
        height = float(held[2]) + self._lane
        above: Array = np.clip(np.array([start[0], start[1], height]), self._low, self._high)
        off = above - measured.position
        distance = hypot(off[0], off[1])
        if self._lane and off[2] > _LANE_TOLERANCE_M and distance > _NO_LANE_WITHIN_M:
            self._nearer_at = now
            return np.array([held[0], held[1], above[2]])
        if distance >= _BLOCKED_WITHIN_M or distance < self._nearest - _RETURNED_WITHIN_M:
            self._nearest, self._nearer_at = distance, now
        there = (
            distance < _RETURNED_WITHIN_M
            and float(measured.velocity @ measured.velocity) < _RETURNED_BELOW_M_S**2
        )
        # Without a time-out, a vehicle whose place is occupied could circle the place for ever.
        if there or (distance < _BLOCKED_WITHIN_M and now - self._nearer_at > _NO_PROGRESS_TIMEOUT_US):
            self._pilot.returned()
        return above
