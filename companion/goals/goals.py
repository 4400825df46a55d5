"""Destination of a plan: the surface around the target, a goal, or a place to hold, land or return to."""

from __future__ import annotations

from math import hypot, inf
from typing import Protocol

import numpy as np

from companion.avoidance.field.planner import Aim, standing
from companion.config import CompanionConfig
from companion.config.formation import Spread
from companion.config.planning import LimitsConfig
from companion.estimation.tracks import State
from companion.goals.formation import even_turn, outside, spacing, taking_part
from companion.goals.settling import Settling
from companion.values.bearings import turned
from companion.values.horizon import Array, Motion
from companion.values.obstacles import Obstacles
from companion.values.phase import Phase
from companion.world import View

_BACK, _STILL = 0.5, 0.5
"""Distance (m) to the start and speed (m/s) below which the vehicle is back."""
_BELOW, _NEARBY = 1.0, 2.0
"""Distance (m) below its lane up to which a vehicle sets off, and to its start at which it needs no lane."""
_BESIDE, _PATIENCE = 5.0, 10_000_000
"""Distance (m) and time (µs): a vehicle this near that has come no nearer for so long is back, too."""


_NOBODY = np.empty((0, 3))
_NOBODY.flags.writeable = False


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
        """Report that the vehicle is back above its start."""
        ...

    def settled(self) -> None:
        """Report that the vehicle hovers and may land."""
        ...


class Goals:
    """Destinations of the vehicle of ``system``.

    ``pilot`` gives the phase, and receives a report when the vehicle is back and when it has settled.
    ``lookahead_s``: how far ahead a plan ends, s.
    """

    def __init__(self, config: CompanionConfig, system: int, pilot: Flight, lookahead_s: float) -> None:
        self._config = config
        self._pilot = pilot
        self._lookahead_s = lookahead_s
        self._surface = config.surface_of(system)
        self._settling = Settling(config)
        self._phase: Phase | None = None
        self._held: Array | None = None
        self._began: Array | None = None
        self._nearest, self._nearer_at = inf, 0
        self._lane, self._clearance = 0.0, self._above_target(system)
        limits = config.limits.within(config.field.margin(1))
        self._low, self._high = np.array(limits.box_min), np.array(limits.box_max)
        self.goal: Array | None = None
        """Ordered goal (3,) of the task ``goto``, m, fleet-local ENU; None for where steering began."""

    def begin(self, place: Array) -> None:
        """Start to steer from ``place`` (3,), m, for the first time or again."""
        self._began = place

    def forget(self, view: View) -> None:
        """Discard what belongs to an earlier phase, or to a target that was lost before."""
        phase = self._pilot.phase
        if phase is not self._phase:
            self._phase, self._held = phase, None
            limits = self._pilot.planned_limits
            self._settling = Settling(self._config.model_copy(update={"limits": limits}))
            self._nearest = inf
        elif phase is Phase.ESCORT and self._config.task == "escort" and view.target is not None:
            self._held = None

    def aim(
        self,
        now: int,
        view: View,
        measured: Motion,
        obstacles: Obstacles,
        mates: Array = _NOBODY,
        below: int = 0,
        *,
        cautious: bool,
    ) -> Aim:
        """Return the aim of a plan at ``now`` (µs) from ``measured`` on.

        ``cautious`` limits the way within a horizon to what ``guard.cautious_speed`` covers. ``obstacles``:
        what settling keeps clear of. ``mates`` (M, 3), m: positions of the others that share the surface.
        ``below``: how many of the others have a smaller id. Raises SurfaceError where the surface has no
        nearest point.
        """
        step = self._config.guard.return_step
        self._lane = step * below + self._clearance if step else 0.0
        aim = self._destination(now, view, measured, obstacles, mates)
        speed = self._config.guard.cautious_speed
        return aim if speed is None or not cautious else self._shortened(aim, measured, speed)

    def _shortened(self, aim: Aim, measured: Motion, speed: float) -> Aim:
        """Return the aim in the same direction, but no further than ``speed`` (m/s) goes in a horizon."""
        drift = aim.target_end - aim.target
        way = aim.destination - drift - measured.position
        far = float(np.linalg.norm(way))
        most = speed * 1e-6 * self._config.horizon.dt_us * (self._config.horizon.steps + 1)
        if far <= most:
            return aim
        return aim._replace(destination=measured.position + drift + most / far * way)

    def _destination(self, now: int, view: View, measured: Motion, obstacles: Obstacles, mates: Array) -> Aim:
        target, phase, task = view.target, self._pilot.phase, self._config.task
        if phase is Phase.RETURN:
            place = self._way_back(now, measured)
        elif phase is Phase.SETTLE:
            place = self._settling.rest(now, measured, obstacles)
            if self._settling.clear:
                self._pilot.settled()
        elif phase is not Phase.HOLD and task == "goto":
            began = measured.position if self._began is None else self._began
            place = began if self.goal is None else self.goal
        elif phase is not Phase.HOLD and target is not None:
            return self._around(target, measured, mates)
        else:
            # Ordered to hold, or there is no target: hold the position, clear of the others.
            place = self._place_to_hold(measured)
        return standing(place, None if target is None else target.position)

    def _around(self, target: State, measured: Motion, mates: Array) -> Aim:
        """Return the aim on the surface around the target's position at the end of the horizon."""
        ahead, rate, surface = self._lookahead_s, self._config.turn_rate, self._surface
        (end,), (velocity,) = target.ahead(np.array([ahead]))
        here = measured.position - target.position
        turn, apart = self._turn(here, mates - target.position)
        offset = surface.nearest(turned(here, turn) if turn else here)
        if rate:
            offset = surface.nearest(turned(offset, rate * ahead))
            velocity = velocity + rate * np.array([-offset[1], offset[0], 0.0])
        if turn:
            offset = outside(offset, turn)
        return Aim(end + offset, velocity, target.position, end, surface, apart)

    def _turn(self, offset: Array, mates: Array) -> tuple[float, float]:
        """Return the angle (rad) by which to go round, and the spacing.

        ``offset`` (3,), m, is the vehicle's from the target. The angle leads towards the vehicle's place
        among ``mates`` (M, 3), also offsets from the target. The spacing (m) is the distance to keep from
        them, ∞ where the surface is not shared.
        """
        formation = self._config.formation
        if not isinstance(formation, Spread) or not len(mates):
            return 0.0, inf
        here = self._surface.nearest(offset)
        others = taking_part(formation, mates, float(np.linalg.norm(here)))
        turn, apart = even_turn(offset, others), inf
        if 0 < len(others) == len(mates):
            apart = spacing(hypot(here[0], here[1]), len(others), turn)
        return max(-formation.turn, min(formation.turn, turn)), apart

    def _place_to_hold(self, measured: Motion) -> Array:
        """Return the position (3,) at the order to hold or to return, or at the loss of the target."""
        if self._held is None:
            self._held = measured.position.copy()
        return self._held

    def _above_target(self, system: int) -> float:
        """Return the climb (m) from the surface after which the target no longer repels the vehicle.

        A vehicle that the target pushes up on its way back would come into the lane above.
        """
        config = self._config
        if config.task != "escort" or config.target_d_safe is None:
            return 0.0
        lowest = float(config.surface_of(system).outline()[:, 2].min())
        return max(config.target_d_safe + config.field.margin(1) - lowest, 0.0)

    def _way_back(self, now: int, measured: Motion) -> Array:
        """Return the place (3,), m, to return to: above the start.

        Its height is the one at the order to return plus the vehicle's lane. It is clipped to the box. A
        vehicle with a lane climbs to it first: while all climb, lanes do not separate them. The pilot
        receives a report when the vehicle is there, or when it is beside the place and comes no nearer.
        """
        start = self._pilot.start
        if start is None:
            return measured.position
        held = self._place_to_hold(measured)
        height = float(held[2]) + self._lane
        above: Array = np.clip(np.array([start[0], start[1], height]), self._low, self._high)
        off = above - measured.position
        far = hypot(off[0], off[1])
        if self._lane and off[2] > _BELOW and far > _NEARBY:
            self._nearer_at = now
            return np.array([held[0], held[1], above[2]])
        if far >= _BESIDE or far < self._nearest - _BACK:
            self._nearest, self._nearer_at = far, now
        there = far < _BACK and float(measured.velocity @ measured.velocity) < _STILL**2
        # A vehicle whose place is taken may go round it for ever.
        if there or (far < _BESIDE and now - self._nearer_at > _PATIENCE):
            self._pilot.returned()
        return above
