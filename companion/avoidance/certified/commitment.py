"""Committed plan of one vehicle from epoch to epoch: when to hold, when to replan, which plan to announce.

In the epoch that begins at t_e every vehicle flies its plan of t_e and makes its plan of t_{e+1}: by solving,
on its own side of all agreed planes; or, without an agreement with a member, by carrying its own plan on. In
both cases it announces the plan of t_{e+1}, and repeats it until the next one. Delivery of messages is never
needed for safety, only for progress.
"""

from __future__ import annotations

from enum import Enum

import numpy as np

from companion.avoidance.certified.committed import (
    carried_on,
    committed,
    committed_with_controls,
    controls,
    controls_and_accelerations,
    horizon_of,
    resting,
    rounding,
)
from companion.avoidance.certified.deadlock import DeadlockTurn, Pushes, mean_velocities
from companion.avoidance.certified.mended_rounding import mended
from companion.avoidance.certified.plan_limits import PlanLimits
from companion.avoidance.certified.qp import Answer, Objective, SeparationQp, State
from companion.avoidance.certified.separating_planes import Others, kept, planes
from companion.avoidance.certified.vicinity import region, within_region
from companion.config.certified import CertifiedConfig
from companion.errors import CertificateError, CompanionError, SolverError
from companion.values.horizon import Array, Horizon, Motion
from companion.ways.subgoal import Subgoal
from mavlink_bridge.wire.plan import WirePlan, quantise


class HoldReason(Enum):
    """Reason for carrying a plan on instead of making a new one."""

    MISSING = "an input is missing: an agreement with a member, the own position, or the destination"
    CLOCK = "the clock of a member, or the own clock, is wrong"
    UNSOLVED = "no plan that keeps all planes was found"
    LATE = "the step took so long that the plan was not sent"
    ROUNDING = "the plan found breaks a plane after rounding, and none keeps it by the rounding error"


class Commitment:
    """Owner of ``current``, the plan that is flown, and ``following``, the plan of the next epoch once made.

    An epoch (µs) is a whole number of knots. ``program`` solves for plans, and each solved plan updates
    ``deadlock_turn``. ``origin``: fingerprint of the fleet frame, for the wire. ``held`` counts, by reason,
    how often the plan was carried on; ``anchored_anew`` how often planning restarted at the measured motion.
    ``sides`` (3,), m: of the box that holds a plan; None: no box but that of the limits.
    """

    def __init__(
        self,
        config: CertifiedConfig,
        program: SeparationQp,
        deadlock_turn: DeadlockTurn,
        origin: int,
        *,
        planar: bool = False,
        sides: Array | None = None,
    ) -> None:
        self._config, self._program, self._origin, self._sides = config, program, origin, sides
        self._deadlock_turn = deadlock_turn
        self._planar = planar
        self._rounding = rounding(program.n, config.dt_us)
        self._limits = PlanLimits(program.n, config.dt_us, program.limits)
        self.announced_until = 0
        """Last epoch (µs) of which a plan was announced."""
        self.current: WirePlan | None = None
        # Caches of values derived from ``current``, and from both plans, which are needed several times.
        self._carried_cache: tuple[WirePlan, WirePlan, Array, Array] | None = None
        self._horizon_cache: tuple[WirePlan, WirePlan | None, float | None, Horizon] | None = None
        self.following: WirePlan | None = None
        self.held: dict[HoldReason, int] = dict.fromkeys(HoldReason, 0)
        self.anchored_anew = 0
        self.height: float | None = None
        """Height (m) that is flown while the current plan is a column; None: that of the plan."""

    def epoch(self, now: int) -> int:
        """Return the beginning (µs) of the epoch that holds ``now`` (µs)."""
        return now - now % self._config.epoch_us

    def begin(self, now: int, position: Array, *, column: bool = False) -> int:
        """Hold ``position`` (3,), m, or its ``column``; return the epoch (µs) of the plan to announce.

        That is the first unannounced one.
        """
        epoch, steps, length = self.epoch(now), self._program.n, self._config.epoch_us
        self.current = resting(epoch, self._config.dt_us, steps, position, self._origin, column=column)
        self.height = None
        free = max(epoch, self.announced_until) + length
        if not self.announced_until:
            # Before a restart the companion may have announced the plan of its next epoch, by a clock ahead.
            free = self.epoch(now + 2 * self._config.clock_us) + 2 * length
        self.following = self.current._replace(epoch=free)
        return free

    def column_at(self, now: int, place: Array) -> WirePlan:
        """Return the column at ``place`` (3,), m, that ``begin`` would begin at ``now`` (µs)."""
        epoch, steps = self.epoch(now), self._program.n
        return resting(epoch, self._config.dt_us, steps, place, self._origin, column=True)

    def turn(self, now: int) -> bool:
        """Advance to the epoch that holds ``now`` (µs); return whether its following plan is to be made."""
        epoch = self.epoch(now)
        if self.following is not None and self.following.epoch <= epoch:
            self.current, self.following = self.following, None
            if not self.current.column:
                self.height = None
        if self.current is not None and self.current.epoch < epoch:
            # No plan was announced in the meantime, so no vehicle can rely on a newer plan.
            self.current = carried_on(self.current, (epoch - self.current.epoch) // self.current.dt)
        return self.current is not None and self.following is None

    def of(self, now: int) -> WirePlan | None:
        """Return the plan of the epoch that holds ``now`` (µs), also before ``turn`` is called in it."""
        following = self.following
        return self.current if following is None or now < following.epoch else following

    @property
    def unannounced(self) -> bool:
        """Whether the current plan was carried on without an announcement, because a step came too late.

        No agreement is made on it: the plan of the next epoch is announced in its place.
        """
        return self.current is not None and self.current.epoch > self.announced_until

    def last_call(self, now: int) -> bool:
        """Return whether at most ``last_call_us`` of the epoch is left: then the plan is carried on."""
        return now + self._config.last_call_us >= self.epoch(now) + self._config.epoch_us

    def carry_on(self, reason: HoldReason) -> None:
        """Continue the committed plan in the next epoch, and count the reason."""
        self.following = self.start()
        self.held[reason] += 1

    @property
    def column(self) -> bool:
        """Whether the newest plan is a column."""
        newest = self.announced()
        return newest is not None and newest.column

    def raise_column(self) -> None:
        """Continue the committed plan in the next epoch as a column: from then on heights do not count."""
        self.following = self.start()._replace(column=True)

    def hover(self, height: float) -> None:
        """Fly the column at ``height`` (m), if that is further than the tube from where it is flown."""
        if self.current is None or not self.current.column:
            return
        flown = self.current.position_m[2] if self.height is None else self.height
        if abs(height - flown) > self._config.tube:
            self.height = height

    def leave_column(self) -> None:
        """Make the column, which rests, a plan in space from the next epoch on, at the height that is flown.

        Another height than that of the plan was flown only while all planes were upright (``hover``), and
        agreements since then are on the column: so this plan keeps them, too.
        """
        start = self.start()
        self.following = start.at_height(start.position_m[2] if self.height is None else self.height)

    def own(self) -> Array:
        """Return control points (n, 3, 3) of the committed plan from the next epoch on, m."""
        return self._carried()[1]

    def start(self) -> WirePlan:
        """Return the committed plan from the next epoch on, at which the next plan begins.

        Raises CompanionError without one.
        """
        return self._carried()[0]

    def replan(self, objective: Objective, goal: Subgoal, others: Others, outside: float = 0.0) -> bool:
        """Make the next epoch's plan; return False if none was found and the old plan is carried on.

        ``goal`` is where the progress of the plan's end is measured. ``outside`` (m): by how much a vehicle
        has left its tube; both sides of each plane together keep twice so much more distance, where their
        committed plans do.

        Raises CompanionError without a committed plan.
        """
        start, own, flown = self._carried()
        # Of the distance beyond the least one, an agreement leaves each side its share: a half, or with
        # ``plane_shift`` more or less. So both sides together keep ``spare`` more.
        spare = self._config.spare + 2.0 * outside
        corridor = planes(own, others, spare, upright=self._planar)
        state = State(own[0, 0], start.velocity_m_s, self._last_acceleration(), flown)
        box = None
        if self._sides is not None:
            # A goal that is turned back would be out of a box that lies towards the goal. A moving
            # destination may be behind the vehicle, too. Either box is one in which the plan may be.
            aim = objective.places[-1]
            turned_back = float((aim - own[0, 0]) @ (goal.place - own[0, 0])) < 0.0
            box = region(own, aim if turned_back else goal.place, self._sides - 2.0 * self._rounding.max())
        # Rounding may violate a plane that is only just kept: the second attempt adds the rounding error, and
        # where that leaves no plan, the first rounded one is mended.
        reason, rounded = HoldReason.UNSOLVED, None
        for attempt in range(2):
            if attempt:
                wanted = np.maximum(corridor.wanted, corridor.least + self._rounding)
                corridor = corridor._replace(wanted=wanted)
            try:
                answer = self._program.solve(state, objective, corridor, box)
                plan, points = committed_with_controls(start, answer.accelerations)
            except (SolverError, CertificateError):
                continue
            reason = HoldReason.ROUNDING
            # The rounded plan is checked, because the others receive the rounded one.
            whole = kept(corridor, points)
            if whole and self._compact(own, points):
                self._adopt(plan, points, answer, objective, goal, others)
                return True
            if not whole and rounded is None:
                rounded = plan, answer
        if rounded is not None:
            better, answer = mended(rounded[0], corridor), rounded[1]
            if better is not None:
                points = controls(better)
                whole = kept(corridor, points) and self._compact(own, points)
                if whole and self._limits.kept(start, own, better, points, state.before):
                    self._adopt(better, points, answer, objective, goal, others)
                    return True
        self.carry_on(reason)
        return False

    def _adopt(
        self,
        plan: WirePlan,
        points: Array,
        answer: Answer,
        objective: Objective,
        goal: Subgoal,
        others: Others,
    ) -> None:
        """Make ``plan``, with control points (n, 3, 3), m, that of the next epoch; learn from ``answer``."""
        length = 1e-6 * self._config.dt_us * self._program.n
        pushes = Pushes(answer.forces, mean_velocities(others, length, len(answer.forces)))
        moving = objective.moving
        gradient = self._program.costs[moving].gradient_per_metre
        seconds = 1e-6 * self._config.epoch_us
        self._deadlock_turn.learn(
            points[-1, 2], goal.place, pushes, gradient, seconds, goal.beyond, moving=moving
        )
        self.following = plan

    def _compact(self, own: Array, points: Array) -> bool:
        """Return whether the plan ``points`` may replace the plan ``own`` (n, 3, 3), m, by its length."""
        return self._sides is None or within_region(own, points, self._sides)

    def anchor(self, now: int, measured: Motion) -> int:
        """Plan the next epoch anew from the ``measured`` motion, to rest; return its beginning (µs).

        This is for a vehicle far from its plan, after a jump of its position or a push. The transition from
        the old plan to this one is not certified.
        """
        begins = self.epoch(now) + self._config.epoch_us
        left = 1e-6 * (begins - now)
        n, dt = self._program.n, 1e-6 * self._config.dt_us
        start = quantise(
            begins,
            self._config.dt_us,
            measured.position + left * measured.velocity,
            measured.velocity,
            np.zeros((n, 3)),
            self._origin,
        )
        slowing = np.repeat(-start.velocity_m_s[None] / ((n - 1) * dt), n, axis=0)
        slowing[-1] = 0.0
        self.following = committed(start, slowing)
        self.anchored_anew += 1
        return begins

    def horizon(self) -> Horizon | None:
        """Return the flown horizon: this epoch's plan, followed by the next one's once that is made."""
        if self.current is None:
            return None
        if (
            self._horizon_cache is None
            or self._horizon_cache[0] is not self.current
            or self._horizon_cache[1] is not self.following
            or self._horizon_cache[2] != self.height
        ):
            horizon = horizon_of(self.current, self.following, self._config.knots)
            if self.height is not None:
                self._flown(horizon.knots, self.height)
            self._horizon_cache = self.current, self.following, self.height, horizon
        return self._horizon_cache[3]

    def _flown(self, knots: Array, height: float) -> None:
        """Set the ``knots`` of columns to the ``height`` (m) that is flown."""
        split = len(knots) if self.following is None else self._config.knots
        for plan, part in ((self.current, knots[:split]), (self.following, knots[split:])):
            if plan is not None and plan.column:
                part[:, 2] = height
                part[:, 5::3] = 0.0

    def announced(self) -> WirePlan | None:
        """Return the plan to announce: the next epoch's or, until that is made, the current one; or None."""
        return self.current if self.following is None else self.following

    def _last_acceleration(self) -> Array:
        """Return the acceleration (3,), m/s², with which this epoch ends."""
        if self.current is None:
            return np.zeros(3)
        x, y, z = self.current.accelerations[self._config.knots - 1]
        return np.array((1e-3 * x, 1e-3 * y, 1e-3 * z))

    def _carried(self) -> tuple[WirePlan, Array, Array]:
        """Return the committed plan from the next epoch on, with its control points and accelerations."""
        if self.current is None:
            raise CompanionError("there is no committed plan yet")
        if self._carried_cache is None or self._carried_cache[0] is not self.current:
            plan = carried_on(self.current, self._config.knots)
            self._carried_cache = self.current, plan, *controls_and_accelerations(plan)
        return self._carried_cache[1:]
