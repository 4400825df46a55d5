"""Where a vehicle has landed, and where it should have, if it was to come back."""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

import numpy as np

from companion.config import CompanionConfig
from companion.estimation.tracks import State
from companion.values.horizon import Array


class Landing(NamedTuple):
    """``returning``: it was on its way back. ``off``: how far (m) from where that led it may stand, in the
    plane, as measured on the ground; None where it was not measured."""

    returning: bool
    off: float | None


def landed(
    config: CompanionConfig, start: Array | None, own: State | None, doubt: float, *, returning: bool
) -> Landing:
    """Of a vehicle that began at ``start`` (3,), fleet-local ENU, and has landed where ``own`` says, to
    within ``doubt`` (m)."""
    if start is None or own is None or own.age > config.guard.own_stale_us:
        return Landing(returning, None)
    limits = config.limits.within(config.field.margin(1))
    # It comes back as near as the box lets it.
    x, y, _ = np.clip(start, limits.box_min, limits.box_max) - own.position
    return Landing(returning, hypot(x, y) + doubt)
