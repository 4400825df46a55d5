"""Planning of what the vehicle flies: the next plan when due, a held plan, or the committed plan."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.commitment import HoldReason
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.field.plan_log import PlanLog
from companion.avoidance.field.planner import Aim, Plan, Planner
from companion.config import CompanionConfig
from companion.config.formation import Spread
from companion.errors import CompanionError, SurfaceError
from companion.flight.guard import Guard
from companion.flight.lowering import Lowered
from companion.flight.state_machine import Pilot
from companion.flight.tracking import Tracking
from companion.goals.goals import Goals
from companion.goals.heading import Heading, Yaw
from companion.obstacles.neighbours import fading
from companion.values.horizon import Array, Horizon, Motion, roll_out
from companion.values.obstacles import Obstacles
from companion.values.phase import Phase
from companion.world import View, World
from mavlink_bridge.frames import LocalFrame

_LONGEST_NS = (1 << 32) - 1
_ZERO = np.zeros(3)
_ZERO.flags.writeable = False
_NOBODY = np.empty((0, 3))
_NOBODY.flags.writeable = False


class Tally(NamedTuple):
    """Counters of one companion so far.

    ``plan_ns``: one stopwatch reading (ns) per plan, at most 4.29 s. ``plan_at``: time (µs on the companion's
    clock) at which that plan was due.
    """

    plans: int
    relaxed: int
    solver_failures: int
    held: int
    anchored_anew: int
    plan_ns: Sequence[int]
    plan_at: Sequence[int] = ()


class Planning:
    """Planning of one vehicle.

    ``world`` holds what is known of the surroundings, ``goals`` gives the destination, and ``pilot`` reports
    whether the companion controls the vehicle. ``certified`` makes committed plans; without it ``planner``
    makes the plans. ``stopwatch`` (ns) only measures how long planning takes, and ``took`` receives the time
    of each plan (ns); nothing depends on them.
    """

    def __init__(
        self,
        config: CompanionConfig,
        world: World,
        pilot: Pilot,
        goals: Goals,
        certified: CertifiedFlight | None,
        stopwatch: Callable[[], int],
        took: Callable[[int], None],
    ) -> None:
        self._config = config
        self._world = world
        self._pilot = pilot
        self._goals = goals
        self._certified = certified
        self._stopwatch, self._told = stopwatch, took
        self.planner = Planner(config)
        self.guard = Guard(config)
        self.tracking = Tracking(config.tracking)
        self._heading = Heading(config.heading, config.horizon)
        self._obstacles = Obstacles((), np.empty((0, 1, 3)), np.empty(0), np.empty(0))
        self._frame: LocalFrame | None = None
        self._shares_surface = isinstance(config.formation, Spread)
        self._lowered = pilot.limits.lowered
        self.fastest: Array = np.array(config.limits.v_max)
        """v_max (3,), m/s, as lowered by the autopilot's parameters."""
        self._fading = fading(config)
        self._flown = 0
        self._plans = self._relaxed = 0
        self._plan_ns = array("I")
        self._plan_at = array("q")
        self.plan: Plan | None = None
        """Last plan of the ``planner``."""
        self.log = PlanLog()
        """Log of all plans of the ``planner`` since the last ``shed``."""
        self.next_due = 0
        """Time (µs) at which the next plan is due; with committed plans, the next yaw."""

    @property
    def tally(self) -> Tally:
        """Counters for the summary."""
        failures, anchored = self.guard.failures, self.guard.anchored_anew
        if self._certified is not None:
            commitment = self._certified.commitment
            failures, anchored = commitment.held[HoldReason.UNSOLVED], commitment.anchored_anew
        return Tally(
            self._plans, self._relaxed, failures, self.held, anchored, self._plan_ns[:], self._plan_at[:]
        )

    @property
    def held(self) -> int:
        """Number of times that an old plan was kept."""
        certified = self._certified
        return self.guard.held if certified is None else sum(certified.commitment.held.values())

    @property
    def spent(self) -> Sequence[int]:
        """Stopwatch readings (ns) of all plans since the last ``shed``."""
        return self._plan_ns

    def shed(self) -> Sequence[int]:
        """Remove and return the stopwatch readings (ns), and empty the log.

        For processes that run for days.
        """
        taken, self._plan_ns = self._plan_ns, array("I")
        self._plan_at = array("q")
        self.log = PlanLog()
        return taken

    def yaw(self, time: int) -> Yaw:
        """Return the planned yaw at ``time`` (µs)."""
        return self._heading.at(time)

    def told(self, now: int, view: View) -> Horizon | None:
        """Return the horizon to share with the neighbours; None with committed plans or if nothing is flown.

        A vehicle that shares a surface with others takes part from its climb on, with its present velocity:
        if the others chose their places without it, they would have to turn round.
        """
        if self._certified is not None:
            return None
        if self.guard.horizon is not None:
            return self.guard.horizon
        rises = self._pilot.phase is Phase.PREPARE and self._pilot.vehicle.armed
        if not self._shares_surface or not rises or view.own is None:
            return None
        n = self._config.horizon.steps + 1
        own, dt = view.own, self._config.horizon.dt_us
        return roll_out(now, dt, own.position, self._bounded(own.velocity), np.zeros((n, 3)))

    def fly(self, now: int, view: View, *, cautious: bool) -> None:
        """Plan when due; start from the measured state each time control of the vehicle begins.

        ``cautious`` limits the way within a horizon to what ``guard.cautious_speed`` covers.
        """
        if view.local is not self._frame:
            # Positions in the old frame must not be flown to in the new one.
            self._frame, self.guard.horizon = view.local, None
        if self._pilot.limits.lowered is not self._lowered:
            self._keep(self._pilot.limits.lowered)
        if self._certified is None and now - self._flown > self._config.guard.hold_us:
            # This process hung and the autopilot flew on its own: the vehicle is no longer where the old plan
            # is.
            self.guard.horizon = None
        self._flown = now
        if not self._pilot.streaming or view.own is None or view.local is None:
            self.guard.rest()
            self.tracking.reset()
            return
        stale = view.own.age > self._config.guard.own_stale_us
        measured = Motion(view.own.position, self._bounded(view.own.velocity), _ZERO)
        if self.guard.horizon is None:
            if stale or view.yaw is None:
                return
            self._begin(now, view.yaw, measured)
        if self._certified is not None:
            self._fly_certified(now, view, measured, self._certified, stale=stale, cautious=cautious)
            return
        if now < self.next_due:
            return
        self.next_due += self._config.rates.replan_us * (
            1 + (now - self.next_due) // self._config.rates.replan_us
        )
        if stale:
            self.guard.hold(now, solver=False)
            self.tracking.forget()
            return
        if not self._pilot.steers(now):
            # Set-points are sent before the autopilot follows them: a plan would run away from the vehicle.
            self.guard.start(now, measured)
            self.tracking.reset()
            return
        self._observe(now, measured)
        self._plan(now, view, measured, cautious=cautious)

    def _keep(self, lowered: Lowered) -> None:
        """Plan, brake and compensate within ``lowered``, the limits that the autopilot can follow."""
        self._lowered = lowered
        self.fastest = np.array(lowered.limits.v_max)
        self.planner.keep(lowered.limits)
        self.guard.keep(lowered.limits)
        self.tracking.keep(lowered.acceleration)

    def _observe(self, now: int, measured: Motion) -> None:
        """Update the tracking with how the vehicle follows the set-points sent."""
        horizon, loop = self.guard.horizon, self._pilot.loop
        if horizon is not None and loop is not None:
            later = horizon.at(now + self.tracking.lead(loop)).acceleration
            sent = horizon.at(now)._replace(acceleration=later)
            self.tracking.observe(now, sent, measured, loop)

    def _begin(self, now: int, yaw: float, measured: Motion) -> None:
        """Start to steer from the ``measured`` state and ``yaw`` (rad, ENU)."""
        self._heading.reset(yaw)
        self._goals.begin(measured.position)
        self.guard.start(now, measured)
        if self._certified is not None:
            self._certified.stand(now, measured.position)

    def _bounded(self, velocity: Array) -> Array:
        """Return a measured ``velocity`` (3,), m/s, clipped to the limits, as the start of a plan.

        Whatever speed the own autopilot reports, or a sender that uses its id, no axis is asked for more than
        its limit.
        """
        return np.minimum(np.maximum(velocity, -self.fastest), self.fastest)

    def _fly_certified(
        self, now: int, view: View, measured: Motion, flight: CertifiedFlight, *, stale: bool, cautious: bool
    ) -> None:
        """Fly the committed plan, and make the next epoch's plan when it is due."""
        if not self._pilot.guided:
            flight.stand(now, measured.position)
        elif not stale:
            flight.watch(now, measured)
        if self._pilot.guided and flight.due(now):
            started = self._stopwatch()
            aim = None if stale else self._aim(now, view, measured, cautious=cautious)
            if aim is None:
                flight.commitment.carry_on(HoldReason.MISSING)
            elif flight.lost:
                flight.commitment.anchor(now, measured)
            else:
                self._plans += flight.plan(now, aim, self._world, view)
            self._took(now, started)
        self.guard.horizon = horizon = flight.horizon()
        if horizon is not None and now >= self.next_due:
            self.next_due = now + self._config.rates.replan_us
            step, count = self._config.horizon.dt_us, self._config.horizon.steps + 1
            self._face(now, view, horizon.positions(now + step, count, step))

    def _plan(self, now: int, view: View, measured: Motion, *, cautious: bool) -> None:
        aim = self._aim(now, view, measured, cautious=cautious)
        if aim is None:
            self.guard.hold(now, solver=False)
            return
        horizon, config = self.guard.horizon, self._config.horizon
        state = self.guard.anchor(now, measured)
        started = self._stopwatch()
        try:
            prediction = (
                np.broadcast_to(state.position, (config.steps + 1, 3))
                if horizon is None
                else horizon.positions(now, config.steps + 1, config.dt_us)
            )
            if self._fading is not None and horizon is not None:
                # The others avoid the vehicle, not its plan.
                prediction = prediction + self._fading * self.tracking.error
            obstacles = self._world.obstacles(now, view, prediction)
            if self._goals.spacing < inf:
                obstacles = obstacles.shared(self._world.neighbours.mate_ids(now), self._goals.spacing)
            self._obstacles = obstacles
            self.plan = self.planner.plan(
                now, state.position, state.velocity, prediction, aim, obstacles, state.acceleration
            )
        except CompanionError:
            self.guard.hold(now, solver=True)
            return
        finally:
            self._took(now, started)
        self._plans += 1
        self.log.add(now, self.plan.gradient)
        self._relaxed += self.plan.relaxed
        self.guard.accept(now, self.plan.horizon)
        self._face(now, view, self.plan.horizon.knots[1:, 0:3])

    def _face(self, now: int, view: View, places: Array) -> None:
        """Plan the yaw along the own ``places`` (N + 1, 3), m, of the next steps.

        A companion that makes no plan keeps its yaw.
        """
        if view.target is None:
            return
        ahead: Array = 1e-6 * self._config.horizon.dt_us * np.arange(1.0, len(places) + 1.0)
        self._heading.plan(now, places, view.target.ahead(ahead).positions)

    def _took(self, now: int, started: int) -> None:
        """Record the plan that was due at ``now`` (µs) and started at stopwatch reading ``started`` (ns)."""
        self._plan_at.append(now)
        spent = min(max(self._stopwatch() - started, 0), _LONGEST_NS)
        self._plan_ns.append(spent)
        self._told(spent)

    def _aim(self, now: int, view: View, measured: Motion, *, cautious: bool) -> Aim | None:
        """Return the aim of the next plan; None if the surface has no nearest point."""
        if self._pilot.phase is Phase.SETTLE:
            # Use the others' present positions: a vehicle that has just begun to steer has no plan yet that
            # was made among them.
            here = np.broadcast_to(measured.position, (self._config.horizon.steps + 1, 3))
            self._obstacles = self._world.obstacles(now, view, here)
        try:
            mates = self._world.neighbours.mates(now) if self._shares_surface else _NOBODY
            below = self._world.neighbours.below if self._config.guard.return_step else 0
            aim = self._goals.aim(now, view, measured, self._obstacles, mates, below, cautious=cautious)
        except SurfaceError:
            return None
        if self._config.traffic is None:
            return aim
        return aim._replace(destination=self._world.sensed.aside(now, aim.destination, measured.position))
