"""Plans of one sender: received or made, filed by the epoch at which they begin."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.committed import controls, rests
from companion.values.horizon import Array
from mavlink_bridge.wire.plan import WirePlan, unpack

_RECENT = 24
"""Number of plans of a sender that are kept without an agreement on them."""


class StoredPlan(NamedTuple):
    """Plan with its control points (n, 3, 3), m; ``rested`` (3n, 3, 3): these and those of its rest."""

    plan: WirePlan
    controls: Array
    rested: Array

    @property
    def still(self) -> bool:
        """Whether the vehicle stays where the plan begins."""
        return bool((self.controls == self.controls[-1, 2]).all())

    def later(self, epoch: int, rows: int) -> Array:
        """Return ``rows`` ≤ 2n control points (rows, 3, 3), m, from ``epoch`` (µs) on.

        After its end the plan rests. ``epoch`` is a knot, and not before the plan's own epoch.
        """
        first = min((epoch - self.plan.epoch) // self.plan.dt, len(self.controls))
        return self.rested[first : first + rows]


def stored(plan: WirePlan) -> StoredPlan:
    """Return ``plan`` with its control points, which are read-only."""
    points = controls(plan)
    data = points.tobytes() + 6 * len(points) * points[-1, 2].tobytes()
    rested: Array = np.frombuffer(data).reshape(-1, 3, 3)
    return StoredPlan(plan, rested[: len(points)], rested)


@lru_cache(maxsize=512)
def read(payload: bytes) -> tuple[StoredPlan, bool]:
    """Return a received plan, and whether it ends at rest; raises PlanWireError.

    If many companions share a process, each payload is decoded once.
    """
    plan = unpack(payload)
    return stored(plan), rests(plan)


class PlanFile:
    """Plans of one sender by epoch (µs)."""

    def __init__(self) -> None:
        self._plans: dict[int, StoredPlan] = {}
        self.newest: StoredPlan | None = None
        """Plan of the latest epoch."""

    def add(self, plan: StoredPlan, needed: Iterable[int] = ()) -> bool:
        """File ``plan``; return False if another plan of its epoch is filed, which is kept.

        Of the plans before, the recent ones and those of the epochs ``needed`` are kept.
        """
        epoch = plan.plan.epoch
        known = self._plans.setdefault(epoch, plan)
        if known.plan != plan.plan:
            return False
        if self.newest is None or epoch > self.newest.plan.epoch:
            self.newest = plan
        if len(self._plans) > 2 * _RECENT:
            wanted = set(needed).union(sorted(self._plans)[-_RECENT:])
            self._plans = {epoch: plan for epoch, plan in self._plans.items() if epoch in wanted}
        return True

    def remove(self, epoch: int) -> None:
        """Discard the plan of ``epoch`` (µs), if it is filed."""
        self._plans.pop(epoch, None)
        last = max(self._plans, default=None)
        self.newest = None if last is None else self._plans[last]

    def clear(self) -> None:
        """Discard all plans."""
        self._plans.clear()
        self.newest = None

    def share(self, length: int, count: int) -> float | None:
        """Return the share that is filed of the plans of ``count`` epochs, of ``length`` (µs) each.

        They are those before the newest plan, which is filed in any case. None if the oldest plan that is
        filed began later. ``count`` is at most ``_RECENT``.
        """
        if self.newest is None:
            return None
        last = self.newest.plan.epoch
        if min(self._plans) > last - count * length:
            return None
        return sum(last - back * length in self._plans for back in range(1, count + 1)) / count

    def get(self, epoch: int) -> StoredPlan | None:
        """Return the plan of ``epoch`` (µs), if it is filed."""
        return self._plans.get(epoch)

    def before(self, epoch: int) -> StoredPlan | None:
        """Return the newest plan that begins at ``epoch`` (µs) or before, if one is filed."""
        if self.newest is not None and self.newest.plan.epoch <= epoch:
            return self.newest
        found = max((known for known in self._plans if known <= epoch), default=None)
        return None if found is None else self._plans[found]
