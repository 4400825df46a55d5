"""Avoidance by the field: a plan when due, otherwise a held plan or a brake (Algorithm 1)."""

from __future__ import annotations

from math import inf

import numpy as np

from companion.avoidance.field.plan_log import PlanLog
from companion.avoidance.field.planner import Aim, Plan, Planner
from companion.config import CompanionConfig
from companion.config.planning import MethodName
from companion.errors import CompanionError
from companion.flight.guard import Guard, Holding
from companion.flight.lowering import Lowered
from companion.flight.state_machine import Pilot
from companion.flight.tracking import Tracking
from companion.obstacles.neighbours import fading
from companion.planning.avoidance import AvoidanceInputs, Tally
from companion.planning.plan_times import PlanTimes
from companion.values.horizon import Array, Horizon, Motion, roll_out
from companion.values.phase import Phase
from companion.values.refused_senders import RefusedSenders
from companion.values.stance import Stance
from companion.values.vectors import clipped
from companion.world import View, World
from mavlink_bridge.messages import Message


class FieldAvoidance:
    """``Avoidance`` by the field.

    ``planner`` makes plans; ``guard`` stores the flown horizon and replaces it by a brake.
    """

    parked = False
    enclosed = False

    def __init__(self, config: CompanionConfig, world: World, pilot: Pilot, times: PlanTimes) -> None:
        self._config, self._world, self._pilot, self._times = config, world, pilot, times
        self.planner = Planner(config)
        self.guard = Guard(config)
        self.tracking = Tracking(config.tracking)
        self.lookahead_s = (config.horizon.steps + 1) * config.horizon.dt_us * 1e-6
        self.next_due = 0
        self.plan: Plan | None = None
        """Last plan of the ``planner``; None before the first."""
        self.log = PlanLog()
        """Log of all plans since the last ``shed``."""
        self._fading = fading(config)
        self._plans = self._relaxed = 0

    @property
    def horizon(self) -> Horizon | None:
        """Horizon that is flown; None while set-points do not steer the vehicle."""
        return self.guard.horizon

    @property
    def state(self) -> Holding:
        """Kind of the horizon that is flown."""
        return self.guard.state

    @property
    def failing(self) -> int | None:
        """Time (µs) at which the solver began to fail; None if its last attempt succeeded."""
        return self.guard.failing

    @property
    def held(self) -> int:
        """Number of times that an old plan was kept."""
        return self.guard.held

    @property
    def tally(self) -> Tally:
        """Counters for the summary."""
        guard, times = self.guard, self._times
        counts = self._plans, self._relaxed, guard.failures, guard.held, guard.anchored_anew
        return Tally(*counts, times.plan_ns[:], times.plan_at[:])

    def refused(self, now: int) -> RefusedSenders:
        """Return nothing: the field uses no committed plans."""
        return RefusedSenders()

    def shed(self) -> None:
        """Empty the log."""
        self.log = PlanLog()

    def use(self, methods: tuple[MethodName, ...]) -> None:
        """Use ``methods`` from the next plan on."""
        self.planner.use(methods)

    def keep(self, lowered: Lowered) -> None:
        """Plan, brake and compensate within ``lowered``, the limits that the autopilot can follow."""
        self.planner.keep(lowered.limits)
        self.guard.keep(lowered.limits)
        self.tracking.keep(lowered.acceleration)

    def begin(self, now: int, measured: Motion) -> None:
        """Start with a brake from the ``measured`` motion; it is flown until the first plan."""
        self.guard.start(now, measured)

    def park(self, now: int, measured: Motion, stance: Stance) -> None:
        """Do nothing: the field does not reserve places."""

    def wait(self, now: int) -> str:
        """Return an empty string: a vehicle takes off and lands without asking others."""
        return ""

    def pause(self, gap: int) -> None:
        """Discard the flown horizon after a long ``gap`` (µs).

        The process hung and the autopilot flew on its own: the vehicle is no longer where the old plan is.
        """
        if gap > self._config.guard.hold_us:
            self.discard()

    def discard(self) -> None:
        """Discard the horizon that is flown."""
        self.guard.horizon = None

    def rest(self, now: int, velocity: Array | None) -> None:
        """Discard the horizon and the state of tracking, because set-points do not steer the vehicle."""
        self.guard.rest()
        self.tracking.reset()

    def finish(self) -> None:
        """Do nothing: nobody relies on the end of a plan of the field."""

    def rests(self, now: int) -> bool:
        """Return True: no plan has to be flown to its end."""
        return True

    def fly(self, now: int, situation: AvoidanceInputs) -> Array | None:
        """Make a plan if one is due; return its positions (N + 1, 3), m, from n = 1 on, otherwise None."""
        period = self._config.rates.replan_us
        if now < self.next_due:
            return None
        self.next_due += period * (1 + (now - self.next_due) // period)
        if situation.stale:
            self.guard.hold(now, solver=False)
            self.tracking.forget()
            return None
        if not self._pilot.steers(now):
            # Until the autopilot follows set-points, a plan would advance while the vehicle does not.
            self.guard.start(now, situation.measured)
            self.tracking.reset()
            return None
        self._observe(now, situation.measured)
        aim = situation.aim()
        if aim is None:
            self.guard.hold(now, solver=False)
            return None
        return self._replan(now, situation, aim)

    def idle(self, now: int) -> bool:
        """Return whether no plan is due at ``now`` (µs)."""
        return now < self.next_due

    def receive(self, now: int, link: str, message: Message) -> bool:
        """Return False: the world picture receives all messages."""
        return False

    def messages(self, now: int, *, farewell: bool) -> list[Message]:
        """Return no messages: the field has none of its own."""
        return []

    def recall(self) -> bool:
        """Return False: a plan of the field is flown whether it was sent or not."""
        return False

    def shared(self, now: int, view: View) -> Horizon | None:
        """Return the horizon to share with the neighbours; None if nothing is flown.

        Exception: a vehicle that shares a surface with others shares its present position and velocity from
        its climb on. Otherwise the others would choose their places without it, and change them later.
        """
        if self.guard.horizon is not None:
            return self.guard.horizon
        rises = self._pilot.phase is Phase.PREPARE and self._pilot.vehicle.armed
        if not self._config.shares_surface or not rises or view.own is None:
            return None
        own, horizon = view.own, self._config.horizon
        limits = self._pilot.planned_limits
        velocity = clipped(own.velocity, np.array(limits.least_v), np.array(limits.v_max))
        return roll_out(now, horizon.dt_us, own.position, velocity, np.zeros((horizon.steps + 1, 3)))

    def _observe(self, now: int, measured: Motion) -> None:
        """Update the tracking with how the vehicle follows the set-points sent."""
        horizon, loop = self.guard.horizon, self._pilot.limits.loop
        if horizon is not None and loop is not None:
            later = horizon.at(now + self.tracking.lead(loop)).acceleration
            sent = horizon.at(now)._replace(acceleration=later)
            self.tracking.observe(now, sent, measured, loop)

    def _replan(self, now: int, situation: AvoidanceInputs, aim: Aim) -> Array | None:
        """Make a plan towards ``aim``; return its positions (N + 1, 3), m, or None if the old one is kept."""
        horizon, config = self.guard.horizon, self._config.horizon
        state = self.guard.anchor(now, situation.measured)
        started = self._times.stopwatch()
        try:
            prediction = (
                np.broadcast_to(state.position, (config.steps + 1, 3))
                if horizon is None
                else horizon.positions(now, config.steps + 1, config.dt_us)
            )
            if self._fading is not None and horizon is not None:
                # The others avoid the measured position: the prediction is shifted by the tracking error.
                prediction = prediction + self._fading * self.tracking.error
            obstacles = self._world.obstacles(now, situation.view, prediction)
            if aim.spacing < inf:
                obstacles = obstacles.shared(self._world.neighbours.mate_ids(now), aim.spacing)
            plan = self.planner.plan(
                now, state.position, state.velocity, prediction, aim, obstacles, state.acceleration
            )
        except CompanionError:
            self.guard.hold(now, solver=True)
            return None
        finally:
            self._times.add(now, started)
        self.plan = plan
        self._plans += 1
        self._relaxed += plan.relaxed
        self.log.add(now, plan.gradient)
        self.guard.accept(now, plan.horizon)
        places: Array = plan.horizon.knots[1:, 0:3]
        return places
