"""Limited range: which pairs need no agreement, and how long plans may be.

A pair without an agreement is judged by what the proof needs. When a vehicle makes a plan beside another with
which it has no agreement, the two were further apart than the range within the last two contact times: by the
rules it had not heard the other within the range, and by the assumption about encounters it would have. An
agreement is dropped for the range alone only while the two are certainly beyond it. On each axis a plan made
anew is no longer than its box, or than the plan before.

Distances are horizontal. Places are those of plans at the beginnings of epochs, and what two vehicles can
approach each other between them is tolerated.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import hypot

import numpy as np

from companion.avoidance.certified.committed import carried_on, controls
from companion.avoidance.certified.margins import fastest, sideways
from companion.avoidance.certified.plan_sides import plan_sides
from companion.config import CompanionConfig
from companion.values.horizon import Array
from mavlink_bridge.wire.plan import WirePlan
from outrider.certify.evidence import Finding, Reach, Terms
from outrider.certify.histories import History, Kind

_EXACT = 1e-9
"""Tolerance (m) for floating-point errors."""
_Place = tuple[float, ...]


class Ranges:
    """Distances between the vehicle of ``history`` and the ``others``, in a fleet with a range."""

    def __init__(self, history: History, others: Sequence[History], terms: Terms, reach: Reach) -> None:
        self._terms, self._reach = terms, reach
        self._own = _places(history)
        self._others = {other.system: _places(other) for other in others}
        self._unheard: dict[tuple[int, int], bool] = {}

    def may_be_unheard(self, system: int, epoch: int) -> tuple[bool, str]:
        """Return whether a plan of ``epoch`` (µs) may be made without an agreement with ``system``.

        The text says how far apart the two were.
        """
        begins = epoch - self._terms.epoch - 2 * self._reach.contact
        most = self._most(system, begins, epoch)
        allowed = most > self._reach.range - self._reach.margins
        return allowed, "" if allowed else f"at most {most:.3f} m apart in the time before"

    def is_unheard(self, system: int, time: int) -> bool:
        """Return whether at ``time`` (µs) a column may be reserved without an agreement with ``system``."""
        key = system, time // self._terms.epoch
        if key not in self._unheard:
            self._unheard[key] = self.may_be_unheard(system, key[1] * self._terms.epoch)[0]
        return self._unheard[key]

    def may_part(self, system: int, since: int, until: int) -> bool:
        """Return whether agreements with ``system`` may have been dropped between two epochs (µs)."""
        return self._most(system, since - self._terms.epoch, until) > self._reach.range + self._reach.margins

    def _most(self, system: int, begins: int, ends: int) -> float:
        """Return the largest horizontal distance (m) in two epochs (µs) and those in between."""
        theirs, length = self._others.get(system), self._terms.epoch
        if not theirs or not self._own:
            return np.inf
        first = begins - begins % length
        pairs = ((self._at(self._own, e), self._at(theirs, e)) for e in range(first, ends + 1, length))
        apart = max(hypot(one[0] - two[0], one[1] - two[1]) for one, two in pairs)
        return apart + 1e-6 * self._reach.speed * length

    def _at(self, places: dict[int, _Place], epoch: int) -> _Place:
        """Return the place at ``epoch`` (µs): that of the last epoch with a plan before, or of the first."""
        found = places.get(epoch)
        if found is None:
            before = max((one for one in places if one <= epoch), default=min(places))
            found = places[epoch] = places[before]
        return found


def too_long(history: History, reach: Reach) -> Iterable[Finding]:
    """Yield a finding for each plan that is made anew and longer than it may be."""
    before = None
    for step in history.steps:
        plan = step.plan
        if step.kind is Kind.MADE and before is not None:
            allowed = np.maximum(reach.sides, _lengths(before, plan.epoch - before.epoch))
            found = _lengths(plan, 0)
            if (found > allowed + _EXACT).any():
                axis = int(np.argmax(found - allowed))
                figures = f"{found[axis]:.3f} m on axis {axis}, at most {allowed[axis]:.3f} m"
                yield Finding("a plan longer than the range allows", (history.system,), plan.epoch, figures)
        before = plan


def _lengths(plan: WirePlan, later: int) -> Array:
    """Return the lengths (3,), m, of the box that holds ``plan`` from ``later`` µs on."""
    lengths: Array = np.ptp(controls(carried_on(plan, later // plan.dt)).reshape(-1, 3), axis=0)
    return lengths


def _places(history: History) -> dict[int, _Place]:
    return {step.plan.epoch: tuple(step.plan.position_m) for step in history.steps}


def reach_of(config: CompanionConfig) -> Reach | None:
    """Return the limited range of a fleet with these settings; None without one."""
    sides, certified = plan_sides(config), config.certified
    if sides is None or certified.range is None:
        return None
    east, north, up = sides.tolist()
    margins = 2.0 * sideways(certified, config.field, config.limits)
    speed = fastest(config.limits)
    return Reach(certified.range, certified.contact_us, margins, (east, north, up), speed)
