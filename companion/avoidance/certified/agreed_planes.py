"""Planes of an agreement: computed once, when it is made, for all times from its beginning on.

Both plans of an agreement are fixed, and end at rest: so are its planes, which each new plan takes from here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.peer_plans import StoredPlan
from companion.avoidance.certified.separating_planes import AGREED
from companion.values.horizon import Array

_ROW = 8 * AGREED
"""Size (bytes) of the row of a segment."""

Rows = Callable[[Array, Array, int], Array]
"""``separating_planes.agreed_planes`` of two plans, of which so many are columns (``Distances.agreed``)."""


class AgreedPlanes(NamedTuple):
    """Planes of an agreement on the plans ``own`` and ``other``.

    ``data``: the memory of 2n + 1 rows of ``separating_planes.agreed_planes``, for the segments from the
    beginning of the later plan on; in the last n + 1 of them both plans rest.
    """

    own: StoredPlan
    other: StoredPlan
    data: bytes

    def later(self, epoch: int) -> bytes:
        """Return the memory of n + 1 rows from ``epoch`` (µs) on: a knot, not before the later plan."""
        own, steps = self.own.plan, len(self.own.controls)
        first = min((epoch - max(own.epoch, self.other.plan.epoch)) // own.dt, steps)
        return self.data[_ROW * first : _ROW * (first + steps + 1)]


def made(own: StoredPlan, other: StoredPlan, rows: Rows) -> AgreedPlanes:
    """Return the planes of an agreement on the plans ``own`` and ``other``, of n knots each."""
    epoch, steps = max(own.plan.epoch, other.plan.epoch), len(own.controls)
    columns = own.plan.column + other.plan.column
    found = rows(own.later(epoch, steps + 1), other.later(epoch, steps + 1), columns)
    return AgreedPlanes(own, other, found.tobytes() + steps * found[-1].tobytes())


def stacked(agreed: list[AgreedPlanes], epoch: int, steps: int) -> Array:
    """Return the rows (A, n + 1, 12) of all ``agreed`` from ``epoch`` (µs) on; n: the ``steps`` of plans."""
    return np.frombuffer(b"".join([one.later(epoch) for one in agreed])).reshape(-1, steps + 1, AGREED)
