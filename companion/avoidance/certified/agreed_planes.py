"""Planes of an agreement: computed once, when it is made, for all times from its beginning on.

Both plans of an agreement are fixed, and end at rest: so are its planes, which each new plan takes from here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.peer_plans import StoredPlan
from companion.avoidance.certified.separating_planes import AGREED
from companion.errors import CompanionError
from companion.values.horizon import Array

_ROW = 8 * AGREED
"""Size (bytes) of the row of a segment."""

Rows = Callable[[Array, Array, int], Array]
"""``separating_planes.agreed_planes`` of two plans, of which so many are columns (``Distances.agreed``)."""


class AgreedPlanes(NamedTuple):
    """Planes of an agreement on the plans ``own`` and ``other``.

    ``data``: the memory of 2n + 1 rows of ``separating_planes.agreed_planes``, for the segments from
    ``epoch`` (µs) on, when the later plan begins; in the last n + 1 of them both plans rest.
    """

    own: StoredPlan
    other: StoredPlan
    epoch: int
    data: bytes


def made(own: StoredPlan, other: StoredPlan, rows: Rows) -> AgreedPlanes:
    """Return the planes of an agreement on the plans ``own`` and ``other``, of n knots each."""
    epoch, steps = max(own.plan.epoch, other.plan.epoch), len(own.controls)
    columns = own.plan.column + other.plan.column
    found = rows(own.later(epoch, steps + 1), other.later(epoch, steps + 1), columns)
    return AgreedPlanes(own, other, epoch, found.tobytes() + steps * found[-1].tobytes())


def stacked(agreed: list[AgreedPlanes], epoch: int, dt: int, steps: int) -> Array:
    """Return the rows (A, n + 1, 13) of all ``agreed`` from ``epoch`` (µs) on.

    ``dt`` (µs) and ``steps`` n: of all plans. Raises CompanionError if ``epoch`` is no knot of ``agreed``, or
    before the beginning of one.
    """
    size, found = _ROW * (steps + 1), []
    for one in agreed:
        knots, between = divmod(epoch - one.epoch, dt)
        if knots < 0 or between:
            raise CompanionError(f"an agreement of {one.epoch} has no planes for {epoch}: no later knot")
        first = _ROW * min(knots, steps)
        found.append(one.data[first : first + size])
    return np.frombuffer(b"".join(found)).reshape(-1, steps + 1, AGREED)
