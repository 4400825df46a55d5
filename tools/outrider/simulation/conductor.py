"""Conductor of a flight from take-off to landing, according to the observed state.

Its steps: take off, send the goals, wait for convergence or the time limit, land.
"""

from __future__ import annotations

from collections import deque
from enum import Enum
from typing import NamedTuple

import numpy as np

from outrider.runs.formation_error import standoff
from outrider.runs.ground_truth import Array
from outrider.scenarios.faults import Restart, Vanish
from outrider.scenarios.scenario import FixedTarget, Scenario
from outrider.scenarios.starts import Starts
from outrider.simulation.covered_goals import CoveredGoals
from outrider.simulation.operator import Operator
from sitl.estimation.profiles import PROFILES

NEAR, SLOW, HOLD = 0.3, 0.3, 1_000_000
"""Limits of convergence: distance from the place (m), speed (m/s), duration (µs)."""
_SIGMAS = 2.0
"""Multiple of the σ of the sensors' position error; the limit of the distance is at least this product.

With the profiles ``truth`` and ``rtk`` the product is less than ``NEAR``.
"""
HOVERING = 0.1
"""Maximum speed of a hover (m/s), with exact sensors; the clock starts when every vehicle hovers."""
_MAX_HOVER_SPEED_M_S = {"truth": HOVERING, "rtk": 0.2, "gnss": 0.4, "sih": 0.4}
_MAX_HOVER_SPEED_IN_TURBULENCE_M_S = 0.8
"""The same limit in turbulent air (m/s)."""
PREPARE_CAP = 90_000_000
"""µs within which all vehicles must hover; otherwise the flight fails."""
_HOVER_TIME_US, _TIME_AFTER_CONVERGENCE_US = 500_000, 5_000_000
_LAND_CAPS = {"land": 60_000_000, "return": 120_000_000}


class Stage(Enum):
    """Stage of the run."""

    PREPARE = "take-off"
    CLOCK = "flight"
    LAND = "landing"
    DONE = "done"


class Observation(NamedTuple):
    """Observed state at ``now`` (µs).

    True positions and velocities (K, 3), and the target's position (3,) or None: ENU. ``ready``: whether all
    companions are in phase ESCORT (in real time: all that have not ended). ``waiting``: the conditions for
    which the others wait. ``armed``: whether any vehicle whose companion has not vanished is armed.
    """

    now: int
    positions: Array
    velocities: Array
    target: Array | None
    ready: bool
    waiting: tuple[str, ...]
    armed: bool


class _Intruder(NamedTuple):
    """A bystander that starts for its goal (3,) ``after`` µs after the goal event."""

    after: int
    system: int
    goal: Array


def _intruders(scenario: Scenario) -> list[_Intruder]:
    """Return the bystanders with a goal, sorted by their starting times."""
    found = [
        _Intruder(round(1e6 * other.after_s), system, np.array(other.goal))
        for system, other in zip(scenario.systems[scenario.vehicles :], scenario.bystanders, strict=True)
        if other.goal is not None
    ]
    return sorted(found, key=lambda intruder: intruder.after)


class _Successor(NamedTuple):
    """A companion that begins ``after`` µs after the goal event, in place of one that has ended."""

    after: int
    system: int


def _successors(scenario: Scenario) -> list[_Successor]:
    """Return the companions that begin in flight, sorted by their beginnings."""
    restarts = [fault for fault in scenario.faults if isinstance(fault, Restart)]
    return sorted(_Successor(round(1e6 * (one.at_s + one.for_s)), one.vehicle) for one in restarts)


class _Arrival:
    """Arrival of several vehicles: ``at`` (µs) is the first time from which on all stay for ``HOLD``."""

    def __init__(self) -> None:
        self.at: int | None = None
        self._since: int | None = None

    def see(self, now: int, *, arrived: bool) -> None:
        """Record whether all have ``arrived`` at ``now`` (µs)."""
        if not arrived:
            self._since = None
            return
        self._since = now if self._since is None else self._since
        if self.at is None and now - self._since >= HOLD:
            self.at = self._since


def _turning_speed(scenario: Scenario) -> float:
    """Return the largest speed (m/s) of a vehicle due to the formation's turn rate; 0 if that is zero."""
    companion = scenario.companion
    if not companion.turn_rate:
        return 0.0
    outlines = [companion.surface_of(system).outline() for system in scenario.systems]
    reach = max(float(np.hypot(outline[:, 0], outline[:, 1]).max()) for outline in outlines)
    return abs(companion.turn_rate) * reach


class Conductor:
    """Sequence of the stages of one flight.

    ``failure``: the reason if the clock never started, the flight was aborted, a companion refused its goal,
    or a vehicle did not land in time.
    """

    def __init__(self, scenario: Scenario, starts: Starts, operator: Operator, epoch: int) -> None:
        """Order the take-off; ``epoch``: beginning of the run, µs."""
        self._scenario, self._starts, self._operator = scenario, starts, operator
        self._epoch = epoch
        self.stage = Stage.PREPARE
        self.clock_start: int | None = None
        self.clock_end: int | None = None
        self.failure: str | None = None
        self._calm_since: int | None = None
        self._all, self._others, self._able = _Arrival(), _Arrival(), _Arrival()
        self._goals = CoveredGoals(scenario, starts.goals, self.near)
        self.covered = 0
        """Number of goals that a vehicle whose companion has ended for good keeps the others from."""
        self._land_at = 0
        target = scenario.target
        jumps = target.jumps if isinstance(target, FixedTarget) else ()
        self._last_jump = round(1e6 * jumps[-1].after_s) if jumps else 0
        ends = [fault.at_s for fault in scenario.faults if isinstance(fault, Vanish)]
        self._last_end = round(1e6 * max(ends, default=0.0))
        self._intruders = deque(_intruders(scenario))
        self._successors = deque(_successors(scenario))
        self._ordered: dict[int, Array] = {}
        """Goals (3,) that were ordered, by system id."""
        self._turning = _turning_speed(scenario)
        for k, system in enumerate(scenario.systems):
            operator.take_off(system, float(starts.positions[k, 2]))

    @property
    def converged_at(self) -> int | None:
        """Time (µs) from which on all vehicles have arrived."""
        return self._all.at

    @property
    def others_converged_at(self) -> int | None:
        """Time (µs) from which on all vehicles have arrived whose companion does not end for good.

        One whose goal is covered has arrived where it rests as near to it as it can (``CoveredGoals``).
        """
        return self._others.at

    @property
    def able_converged_at(self) -> int | None:
        """Time (µs) from which on all those of ``others_converged_at`` have arrived whose goals are free."""
        return self._able.at

    @property
    def near(self) -> float:
        """Distance (m) from its place within which a vehicle has arrived."""
        return max(NEAR, _SIGMAS * PROFILES[self._scenario.sensors].deviation)

    def see(self, sight: Observation) -> bool:
        """Advance to the next stage if it is time; return True when the flight is over."""
        if self.stage is Stage.PREPARE:
            self._prepare(sight)
        elif self.stage is Stage.CLOCK:
            self._count(sight)
        elif self.stage is Stage.LAND:
            if not sight.armed:
                self.stage = Stage.DONE
            elif sight.now - self._land_at > (cap := _LAND_CAPS[self._scenario.ending]):
                order = self._scenario.ending
                late = f"not all vehicles were down {cap // 1_000_000} s after the order to {order}"
                self.failure = late if self.failure is None else f"{self.failure}; {late}"
                self.stage = Stage.DONE
        return self.stage is Stage.DONE

    def abort(self, now: int, why: str) -> None:
        """Order the landing and record ``why`` as the failure, unless the landing has begun already."""
        if self.stage in (Stage.PREPARE, Stage.CLOCK):
            self.failure = why
            if self.clock_start is not None:
                self.clock_end = now
            self._land(now)

    def errors(self, sight: Observation) -> Array:
        """Return the distance (vehicles,), m, of each vehicle from its place, without bystanders.

        The place is its goal or, without goals, its surface around the target; NaN if the target is absent.
        """
        positions = sight.positions[: self._scenario.vehicles]
        if self._starts.goals is not None:
            return np.asarray(np.linalg.norm(positions - self._starts.goals, axis=1))
        if sight.target is None:
            return np.full(len(positions), np.nan)
        return standoff(self._scenario, positions, sight.target)

    def _prepare(self, sight: Observation) -> None:
        now, still = sight.now, _MAX_HOVER_SPEED_M_S[self._scenario.sensors]
        if self._scenario.weather.w20 > 0.0:
            still = _MAX_HOVER_SPEED_IN_TURBULENCE_M_S
        # The vehicles of a formation that turns around the target are never at rest.
        still += self._turning
        calm = sight.ready and float(np.linalg.norm(sight.velocities, axis=1).max()) < still
        if not calm:
            self._calm_since = None
            if now - self._epoch > PREPARE_CAP:
                self.failure = "; ".join(sight.waiting) or "the vehicles do not come to a hover"
                self._land(now)
            return
        self._calm_since = now if self._calm_since is None else self._calm_since
        if now - self._calm_since < _HOVER_TIME_US:
            return
        self.stage, self.clock_start = Stage.CLOCK, now
        if self._starts.goals is not None:
            for system, goal in zip(self._scenario.systems, self._starts.goals, strict=False):
                self._order(system, goal)

    def _order(self, system: int, goal: Array) -> None:
        self._ordered[system] = goal
        self._operator.goal(system, goal)

    def _order_again(self, system: int) -> None:
        """Give the go and the goal to a companion that has just begun."""
        height = float(self._starts.positions[self._scenario.systems.index(system), 2])
        self._operator.take_off(system, height)
        if system in self._ordered:
            self._operator.goal(system, self._ordered[system])

    def _count(self, sight: Observation) -> None:
        now = sight.now
        since = now - (self.clock_start or 0)
        while self._intruders and self._intruders[0].after <= since:
            _, system, goal = self._intruders.popleft()
            self._order(system, goal)
        while self._successors and self._successors[0].after <= since:
            self._order_again(self._successors.popleft().system)
        if self._scenario.has_goal and since >= self._last_jump:
            speeds = np.linalg.norm(sight.velocities[: self._scenario.vehicles], axis=1)
            errors, still = self.errors(sight), speeds < SLOW
            arrived = (errors < self.near) & still
            goals = self._goals
            goals.see(since, sight.positions, sight.velocities)
            self.covered = int(goals.covered.sum())
            self._all.see(now, arrived=bool(arrived.all()))
            rest = (errors < goals.away + self.near) & still
            self._others.see(now, arrived=bool(goals.lasting.any() and rest[goals.lasting].all()))
            able = goals.lasting & ~goals.covered
            self._able.see(now, arrived=bool(able.any() and arrived[able].all()))
        over = since >= self._scenario.duration_s * 1e6
        arrived_at = self._arrived_at(now - since, since)
        if arrived_at is not None:
            over = now >= arrived_at + HOLD + _TIME_AFTER_CONVERGENCE_US
        if over:
            self.clock_end = now
            self.failure = self._operator.refusal(self._ordered)
            if self._scenario.airborne:
                self.stage = Stage.DONE
            else:
                self._land(now)

    def _arrived_at(self, start: int, since: int) -> int | None:
        """Return the time (µs) of the arrival that ends the flight; None while it has not come.

        ``start`` (µs): beginning of the clock; ``since`` (µs): its reading. With ``arrival: others`` this
        arrival does not come before the last companion has ended for good, so that the flight shows the
        result of that, too. If that end is later than the time limit, the limit ends the flight.
        """
        if self.converged_at is not None or self._scenario.arrival == "all":
            return self.converged_at
        others = self.others_converged_at
        if others is None or since < self._last_end:
            return None
        return max(others, start + self._last_end)

    def _land(self, now: int) -> None:
        self.stage, self._land_at = Stage.LAND, now
        order = self._operator.come_back if self._scenario.ending == "return" else self._operator.land
        for system in self._scenario.systems:
            order(system)
