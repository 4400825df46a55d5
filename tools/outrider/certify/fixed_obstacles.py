"""Distances of all plans from fixed obstacles, at all times of each plan.

The bound of a vehicle and an obstacle is the required distance or, if the plan with which the vehicle began
is nearer, the largest distance of a plan since then: plans keep min(present distance, required) on each
segment. For the bound the distance of a plan is that of the hulls of its control points, which plans keep;
the curve itself, which is checked against it, is never nearer. Inside an obstacle distances are negative: a
vehicle that began there, or close round a corner, has a negative bound, and may not come deeper. A vehicle
begins at its first plan, after a farewell, at an anchor, and where a column becomes a plan in space.

In a column that its autopilot climbs or descends, a vehicle has no planned height. The place of a landing is
checked: from the plan's height down, no obstacle is nearer than required.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.committed import carried_on, controls
from companion.config.obstacles import Obstacle
from companion.values.horizon import Array
from mavlink_bridge.wire.plan import WirePlan
from outrider.certify.evidence import Finding, Log, Terms
from outrider.certify.heights import Span, within
from outrider.certify.histories import History, Kind
from outrider.certify.solids import Rows, Solids
from outrider.scenarios.feasibility import described

SLACK = 1e-6
"""Tolerance for floating-point errors and that of a least distance (m)."""
_REPORTED_M = 1.0
"""Distance (m) beyond the required one up to which the least distance is reported."""
_REGION_M = 10.0
"""m by which the region for which obstacles are searched is wider than a plan."""


class NearestObstacle(NamedTuple):
    """Least distance (m) of a plan from a fixed obstacle, the vehicle, the time (µs) and the obstacle.

    Inside the obstacle the distance is negative.
    """

    distance: float
    system: int
    time: int
    obstacle: str


class Kept(NamedTuple):
    """Result: number of pairs of a plan and an obstacle near it that were ``checked``."""

    checked: int
    nearest: NearestObstacle | None
    findings: list[Finding]


class _Breach(NamedTuple):
    """Plans of one vehicle nearer than its bound to one obstacle: the worst, their number, and the bound."""

    worst: NearestObstacle
    plans: int
    bound: float


def check(
    histories: Sequence[History],
    obstacles: Mapping[int, Sequence[Obstacle]],
    terms: Terms,
    logs: Sequence[Log] = (),
    spans: Sequence[tuple[Span, ...]] = (),
) -> Kept:
    """Check all plans of ``histories`` against the ``obstacles`` that their vehicles are configured with.

    ``spans``: for each history, when the vehicle's autopilot decides on its height; ``logs`` have the orders
    to land.
    """
    spans = spans or [()] * len(histories)
    by_owner = {log.owner: log for log in logs}
    solids: dict[int, Solids] = {}
    checked = 0
    nearest: list[NearestObstacle] = []
    findings: list[Finding] = []
    for history, decides in zip(histories, spans, strict=True):
        known = obstacles.get(history.system, ())
        if not known:
            continue
        # All vehicles of a scenario have the same ones.
        if id(known) not in solids:
            solids[id(known)] = Solids(known)
        vehicle = _Vehicle(history.system, known, solids[id(known)], terms)
        for step, before in zip(history.steps, (None, *history.steps), strict=False):
            epoch = step.plan.epoch
            if step.plan.column and within(decides, epoch, epoch + terms.epoch):
                continue
            space = before is not None and before.plan.column and not step.plan.column
            if before is not None and step.kind is Kind.MADE:
                # It is made beside what was left of the plan before.
                left = carried_on(before.plan, (epoch - before.plan.epoch) // terms.dt)
                vehicle.see(left, begins=False, made=False)
            anew = step.kind in (Kind.FIRST, Kind.ANCHOR) or space
            vehicle.see(step.plan, begins=anew, made=step.kind is not Kind.CARRIED_ON)
        orders = by_owner[history.system].orders if history.system in by_owner else ()
        findings += vehicle.findings()
        findings += vehicle.landings(history, [order.time for order in orders if not order.climbs])
        checked += vehicle.checked
        if vehicle.nearest is not None:
            nearest.append(vehicle.nearest)
    return Kept(checked, min(nearest, default=None), findings)


class _Vehicle:
    """Check of the plans of one vehicle, from epoch to epoch."""

    def __init__(self, system: int, known: Sequence[Obstacle], solids: Solids, terms: Terms) -> None:
        self._system, self._known, self._solids, self._terms = system, known, solids, terms
        self._within = terms.surface + _REPORTED_M
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._rows = np.empty(0, dtype=np.int64)
        self._bounds: dict[int, float] = {}
        """Bounds (m) of obstacles to which the vehicle began nearer than required, by row."""
        self._breaches: dict[int, _Breach] = {}
        self.checked = 0
        self.nearest: NearestObstacle | None = None

    def see(self, plan: WirePlan, *, begins: bool, made: bool) -> None:
        """Add the ``plan`` of an epoch: ``begins`` anew, ``made`` in contrast to carried on."""
        if not (begins or made or self._bounds):
            return
        points = controls(plan)
        rows = self._near(points)
        least = self._solids.least(points, rows, self._within)
        near = np.flatnonzero(np.isfinite(least.distance))
        hulls = dict(zip(rows[near].tolist(), least.hull[near].tolist(), strict=True))
        if begins:
            self._bounds = dict.fromkeys(hulls, -np.inf)
        if begins or made:
            for k in near.tolist():
                row, later = int(rows[k]), (least.segment[k] + least.share[k]) * plan.dt
                time = plan.epoch + round(later)
                here = NearestObstacle(float(least.distance[k]), self._system, time, self._name(row))
                self.nearest = here if self.nearest is None else min(self.nearest, here)
                self.checked += 1
                if not begins:
                    self._judge(row, here)
        required = self._terms.surface
        raised = {row: max(bound, hulls.get(row, np.inf)) for row, bound in self._bounds.items()}
        self._bounds = {row: bound for row, bound in raised.items() if bound < required}

    def _judge(self, row: int, here: NearestObstacle) -> None:
        """Compare the least distance of a plan from the obstacle of a row with the bound."""
        bound = self._bounds.get(row, self._terms.surface)
        if here.distance < bound - SLACK:
            worst, count, _ = self._breaches.get(row, _Breach(here, 0, bound))
            self._breaches[row] = _Breach(min(worst, here), count + 1, bound)

    def findings(self) -> Iterable[Finding]:
        """Yield a finding for each obstacle to which plans are nearer than certified."""
        for breach in self._breaches.values():
            figures = f"{self._figures(breach.worst, breach.bound)}; in {breach.plans} plans"
            what = "a plan nearer to a fixed obstacle than certified"
            yield Finding(what, (self._system,), breach.worst.time, figures)

    def landings(self, history: History, orders: Iterable[int]) -> Iterable[Finding]:
        """Yield a finding for each of the ``orders`` (µs) to land at a place too near an obstacle."""
        for time in orders:
            flown = [step.plan for step in history.steps if step.plan.epoch <= time]
            if not flown:
                continue
            rests = controls(carried_on(flown[-1], (time - flown[-1].epoch) // flown[-1].dt))[-1, 2]
            lowest = np.append(rests[:2], -np.inf)
            rows = self._solids.near(lowest, rests, self._terms.surface)
            for row, distance in zip(rows.tolist(), self._solids.below(rests, rows).tolist(), strict=True):
                if distance < self._terms.surface - SLACK:
                    here = NearestObstacle(distance, self._system, time, self._name(row))
                    figures = self._figures(here, self._terms.surface)
                    yield Finding("a landing too near a fixed obstacle", (self._system,), time, figures)

    def _figures(self, one: NearestObstacle, bound: float) -> str:
        return f"{one.obstacle}: {one.distance:.6f} m, at least {bound:.6f} m"

    def _name(self, row: int) -> str:
        return f"obstacles[{row}], {described(self._known[row])}"

    def _near(self, points: Array) -> Rows:
        """Return the obstacles that may be near control points (n, 3, 3); searched once for a region."""
        low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
        if (low < self._low).any() or (high > self._high).any():
            self._low, self._high = low - _REGION_M, high + _REGION_M
            self._rows = self._solids.near(self._low, self._high, self._within)
        return self._rows
