"""Planning of the position by avoidance, and of the yaw towards the target."""

from __future__ import annotations

from functools import partial

import numpy as np

from companion.avoidance.field.planner import Aim
from companion.config import CompanionConfig
from companion.config.formation import Perception
from companion.config.planning import LimitsConfig
from companion.errors import SurfaceError
from companion.flight.lowering import Lowered
from companion.flight.state_machine import Pilot
from companion.goals.goals import Goals
from companion.goals.heading import Heading, Yaw
from companion.planning.avoidance import Avoidance, AvoidanceInputs
from companion.values.horizon import Array, Motion
from companion.values.mates import Mates, Sight
from companion.values.obstacles import Obstacles
from companion.values.phase import Phase
from companion.values.stance import Stance
from companion.values.vectors import clipped
from companion.world import View, World
from mavlink_bridge.frames import LocalFrame

_ZERO = np.zeros(3)
_ZERO.flags.writeable = False
_NO_MATES, _NO_SIGHT = Mates(), Sight()
_NO_OBSTACLES = Obstacles((), np.empty((0, 1, 3)), np.empty(0), np.empty(0))


def _velocities(limits: LimitsConfig) -> Array:
    """Return the least and largest velocity (2, 3), m/s."""
    return np.array([limits.least_v, limits.v_max])


class Planning:
    """Planning of one vehicle by ``avoidance``.

    ``world`` gives the obstacles, ``goals`` the destination, and ``pilot`` reports whether the companion
    controls the vehicle.
    """

    def __init__(
        self, config: CompanionConfig, world: World, pilot: Pilot, goals: Goals, avoidance: Avoidance
    ) -> None:
        self._config, self._world, self._pilot, self._goals = config, world, pilot, goals
        self._avoidance = avoidance
        self._heading = Heading(config.heading, config.horizon)
        self._frame: LocalFrame | None = None
        self._lowered = pilot.planned.lowered
        self.velocities: Array = _velocities(config.limits)
        """Least and largest velocity (2, 3), m/s, as lowered by the autopilot's parameters."""
        self._stepped = 0
        # Times (s) of the steps of a plan, n = 1…N + 1.
        self._ahead: Array = 1e-6 * config.horizon.dt_us * np.arange(1.0, config.horizon.steps + 2.0)

    def yaw(self, time: int) -> Yaw:
        """Return the planned yaw at ``time`` (µs)."""
        return self._heading.at(time)

    def step(self, now: int, view: View, *, cautious: bool) -> None:
        """Plan when due; start from the measured state each time control of the vehicle begins.

        ``cautious`` limits the distance to the destination to ``guard.cautious_speed`` times the horizon.
        """
        avoidance = self._avoidance
        if view.local is not self._frame:
            # Positions in the old frame must not be flown to in the new one.
            self._frame = view.local
            avoidance.discard()
        if (lowered := self._pilot.planned.lowered) is not self._lowered:
            self._keep(lowered)
        avoidance.pause(now - self._stepped)
        self._stepped = now
        if view.own is None or view.local is None:
            avoidance.rest(now, None if view.own is None else view.own.velocity)
            return
        stale = view.own.age > self._config.guard.own_stale_us
        # A faulty autopilot, or a sender that uses its id, must not cause set-points beyond v_min or v_max.
        measured = Motion(view.own.position, clipped(view.own.velocity, *self.velocities), _ZERO)
        if not self._pilot.streaming:
            avoidance.rest(now, view.own.velocity)
            stance = self._pilot.stance
            if stance is Stance.CLIMBS or (stance.grounded and not stale):
                avoidance.park(now, measured, stance)
            return
        if avoidance.horizon is None:
            if stale or view.yaw is None:
                return
            self._heading.reset(view.yaw)
            self._goals.begin(measured.position)
            avoidance.begin(now, measured)
        aim = partial(self._aim, now, view, measured, cautious=cautious)
        places = avoidance.fly(now, AvoidanceInputs(view, measured, stale, aim))
        if places is not None:
            self._face(now, view, places)

    def _keep(self, lowered: Lowered) -> None:
        """Plan within ``lowered``, the limits that the autopilot can follow."""
        self._lowered = lowered
        self.velocities = _velocities(lowered.limits)
        self._avoidance.keep(lowered)

    def _face(self, now: int, view: View, places: Array) -> None:
        """Plan the yaw along the own ``places`` (N + 1, 3), m, of the next steps.

        Without a target no new yaw is planned: the last yaw plan continues to its end.
        """
        if view.target is None:
            return
        self._heading.plan(now, places, view.target.ahead(self._ahead).positions)

    def _aim(self, now: int, view: View, measured: Motion, *, cautious: bool) -> Aim | None:
        """Return the aim of the next plan; None if the function of a user's surface fails."""
        obstacles = _NO_OBSTACLES
        if self._pilot.phase is Phase.SETTLE:
            # The vehicle settles near its measured position: obstacles near this position are needed.
            here = np.broadcast_to(measured.position, (self._config.horizon.steps + 1, 3))
            obstacles = self._world.obstacles(now, view, here)
        try:
            mates = self._world.neighbours.mates(now) if self._config.shares_surface else _NO_MATES
            below = self._world.neighbours.below if self._config.return_step else 0
            sight = _NO_SIGHT
            if isinstance(self._config.formation, Perception):
                sight = self._world.sight(now, self._avoidance.lookahead_s)
            bounds = self._world.neighbours.bounds(now, measured.position)
            aim = self._goals.aim(
                now, view, measured, obstacles, mates, below, sight, bounds, cautious=cautious
            )
        except SurfaceError:
            return None
        if self._config.traffic is None:
            return aim
        return aim._replace(destination=self._world.sensed.aside(now, aim.destination, measured.position))
