"""Planner: destination → forces → QP → plan, Algorithm 1 of the paper."""

from __future__ import annotations

from collections.abc import Callable
from math import expm1, inf
from typing import NamedTuple

import numpy as np

from companion.avoidance.field.dqmpc import Dqmpc, Problem
from companion.avoidance.field.forces import repulsion, smoothed
from companion.avoidance.field.jerk import Flown, rate_limited
from companion.avoidance.field.methods import Influence, Method, Scene
from companion.avoidance.field.methods.approach_angle import ApproachAngle
from companion.avoidance.field.methods.swivel import Swivel
from companion.avoidance.field.methods.tangential import Tangential
from companion.avoidance.field.walls import Walls
from companion.config import CompanionConfig
from companion.config.planning import LimitsConfig, MethodName
from companion.obstacles.static import FIRST_ID
from companion.surfaces import Surface
from companion.values.horizon import Array, Horizon, roll_out
from companion.values.obstacles import Obstacles
from companion.values.speed_bounds import Slowing, SpeedBounds

_ZERO = np.zeros(3)
_ZERO.flags.writeable = False


class Aim(NamedTuple):
    """Aim of a plan at the end of the horizon, fleet-local ENU.

    ``destination`` x̌ (3,) and terminal ``velocity`` (3,); ``target`` (3,) now and ``target_end`` (3,) at the
    end of the horizon. ``surface`` is the one that x̌ lies on, None for a goal. ``spacing``: distance (m)
    that vehicles that share the surface shall keep; ∞ where it is not shared. ``path`` gives the places and
    velocities of a destination that moves after times (n,), s, from now; None for one at rest. ``clear``:
    no fixed obstacle is between the vehicle and x̌, which is on a way around them. ``bounds``: what the speed
    of the plan keeps beside unheard neighbours; None if all are heard. ``given``: x̌ is a goal that the
    vehicle was given, and not a place to hold, to return to or to settle at.
    """

    destination: Array
    velocity: Array
    target: Array
    target_end: Array
    surface: Surface | None = None
    spacing: float = inf
    path: Callable[[Array], tuple[Array, Array]] | None = None
    clear: bool = False
    bounds: SpeedBounds | None = None
    given: bool = False


def standing(goal: Array, target: Array | None = None) -> Aim:
    """Return the aim to come to rest at ``goal`` (3,), facing ``target`` (3,), m."""
    seen = goal if target is None else target
    return Aim(goal, np.zeros(3), seen, seen)


class Plan(NamedTuple):
    """Solved plan and its inputs. ``gradient`` is ∇J (3,), divided by Ω_t."""

    horizon: Horizon
    aim: Aim
    force: Array
    gradient: Array
    omega_scale: float
    relaxed: int
    problem: Problem


class Planner:
    """Planner of one vehicle; keeps the last gradient, the last field, and what the methods latch."""

    def __init__(self, config: CompanionConfig) -> None:
        self.config = config
        self._limit(config.limits.within(config.field.margin(1)))
        self._methods = build(config)
        self._fixed = range(FIRST_ID, FIRST_ID + len(config.obstacles))
        self._gradient: Array = np.zeros(3)
        self._force: Array = np.zeros((config.horizon.steps + 1, 3))
        self._planned_at: int | None = None

    def use(self, methods: tuple[MethodName, ...]) -> None:
        """Use ``methods`` from the next plan on, with nothing latched."""
        self.config = self.config.model_copy(update={"methods": methods})
        self._methods = build(self.config)

    def keep(self, limits: LimitsConfig) -> None:
        """Keep other ``limits`` from the next plan on, with nothing latched."""
        self.config = config = self.config.model_copy(update={"limits": limits})
        self._limit(limits.within(config.field.margin(1)))
        self._methods = build(config)

    def _limit(self, limits: LimitsConfig) -> None:
        """Plan within ``limits``."""
        self.dqmpc = Dqmpc(self.config.horizon, self.config.cost, limits)
        flown_us = self.config.guard.hold_us + self.config.rates.replan_us
        self._walls = Walls(limits, self.dqmpc.dt, 1e-6 * flown_us)
        self._slowing = Slowing(self.dqmpc.dt, limits.a_total, limits.j_max)

    def plan(
        self,
        now: int,
        position: Array,
        velocity: Array,
        prediction: Array,
        aim: Aim,
        obstacles: Obstacles,
        acceleration: Array = _ZERO,
    ) -> Plan:
        """Return a plan from the state at ``now`` (µs).

        ``acceleration`` (3,), m/s², is flown until then. ``prediction`` (N + 1, 3), m, is the previous plan
        at n = 0…N. Raises SolverError when there is no solution: the caller keeps the plan that it has.
        """
        to_go = aim.destination - (aim.target_end - aim.target) - position
        scene = Scene(
            position,
            velocity,
            prediction,
            aim.destination,
            aim.velocity,
            to_go,
            aim.target,
            obstacles,
            self._gradient,
            aim.target_end,
            aim.surface,
        )
        elapsed = self._elapsed(now)
        influence = self._influence(elapsed, scene, clear=aim.clear)
        problem = self.dqmpc.problem(
            position,
            velocity,
            influence.force,
            influence.destination,
            aim.velocity,
            influence.omega_scale,
            None if self.config.limits.j_max is None else Flown(acceleration, elapsed),
        )
        solution = self.dqmpc.solve(problem, influence.omega_scale)
        if aim.bounds is not None:
            self._slowing.keep(position, velocity, acceleration, elapsed, aim.bounds, solution.acceleration)
        self._walls.keep(position, velocity, acceleration, elapsed, solution.acceleration)
        horizon = roll_out(now, self.config.horizon.dt_us, position, velocity, solution.acceleration)
        end = horizon.knots[-1]
        self._gradient = self.dqmpc.gradient(
            solution.acceleration, end[0:3], end[3:6], influence.destination, aim.velocity
        )
        return Plan(
            horizon, aim, influence.force, self._gradient, influence.omega_scale, solution.relaxed, problem
        )

    def _elapsed(self, now: int) -> float:
        """Return the time (s) since the last plan; ∞ for the first."""
        last, self._planned_at = self._planned_at, now
        return inf if last is None else (now - last) * 1e-6

    def _influence(self, elapsed: float, scene: Scene, *, clear: bool) -> Influence:
        config = self.config
        a_total = config.limits.a_total
        field = repulsion(
            scene.prediction,
            scene.obstacles,
            config.field.gain,
            _NEAREST_COUNTS * a_total,
            config.field.braking,
            self.dqmpc.dt,
            config.field.reaction,
            config.field.turn * _SIGNS[config.turning_sense],
        )
        influence = Influence(field, 1.0, scene.destination)
        if clear:
            # The methods lead around what is in the way: nothing fixed is.
            scene = scene._replace(obstacles=scene.obstacles.without(self._fixed))
        for method in self._methods:
            influence = method.influence(scene, influence)
        force = influence.force
        if not config.planar:
            force = self._walls.aside(force, scene.prediction[:, 2], scene.velocity, scene.to_go)
        force = self._smoothed(elapsed, force)
        return Influence(force, influence.omega_scale, influence.destination)

    def _smoothed(self, elapsed: float, force: Array) -> Array:
        """Return the field limited to a_total, and smoothed in time.

        Neighbours' plans arrive at 10 Hz; each would cause a step of the field and of the attitude. With
        bounded jerk the field changes no faster than the acceleration may, in time and along the horizon.
        """
        config, dt = self.config, self.dqmpc.dt
        j_max, smoothing = config.limits.j_max, config.field.smoothing_us
        share = 1.0
        if j_max is None and elapsed < inf and smoothing > 0:
            share = -expm1(-1e6 * elapsed / smoothing)
        # The last field has moved on along its horizon since, which matters where plans are made seldom.
        last = self._force[int(min(elapsed / dt, len(self._force) - 1))]
        force = smoothed(force, config.limits.a_total, self._force, share, planar=config.planar)
        if j_max is not None:
            jerk = min(j_max)
            force = rate_limited(force, last, jerk * min(elapsed, dt), jerk * dt)
        self._force = force
        return force


_SIGNS = {"own": 0.0, "right": 1.0, "left": -1.0}
"""Sign of the angle by which forces are turned; 0 where each vehicle has a turning sense of its own."""
_NEAREST_COUNTS = 20.0
"""Clamp of one force, as a multiple of a_total.

The sum is limited to a_total, not its parts: otherwise two obstacles that push from behind would cancel one
that is about to be hit.
"""


def build(config: CompanionConfig) -> list[Method]:
    """Return the methods that the configuration names, in its order; ``baseline`` adds nothing."""
    u_max, dt = max(config.limits.strongest), config.horizon.dt_us * 1e-6
    makers: dict[str, Callable[[], Method]] = {
        "swivel": lambda: Swivel(config.swivel, config.turning_sense),
        "approach_angle": lambda: ApproachAngle(config.approach_angle, config.turning_sense),
        "tangential": lambda: Tangential(config.tangential, config.turning_sense, u_max, dt),
    }
    return [makers[name]() for name in config.methods if name != "baseline"]
