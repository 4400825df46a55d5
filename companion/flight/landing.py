"""Landing position of a vehicle, compared with its starting position."""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

import numpy as np

from companion.config import CompanionConfig
from companion.estimation.tracks import State
from companion.values.horizon import Array


class Landing(NamedTuple):
    """A completed landing.

    ``returning``: the vehicle was returning to its start. ``off``: upper bound (m) of its horizontal distance
    from the return position, by the estimate on the ground; None without a start or a fresh own state.
    """

    returning: bool
    off: float | None


def landed(
    config: CompanionConfig, start: Array | None, own: State | None, doubt: float, *, returning: bool
) -> Landing:
    """Return the landing of a vehicle that started at ``start`` (3,), m, fleet-local ENU.

    ``own``: its state on the ground; ``doubt``: uncertainty (m) of its position.
    """
    if start is None or own is None or own.age > config.guard.own_stale_us:
        return Landing(returning, None)
    limits = config.limits.within(config.field.margin(1))
    # The vehicle returns as near to its start as the box of its limits permits.
    x, y, _ = np.clip(start, limits.box_min, limits.box_max) - own.position
    return Landing(returning, hypot(x, y) + doubt)
