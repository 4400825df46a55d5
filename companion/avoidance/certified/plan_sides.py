"""How long the plans of a fleet with ``certified.range`` may be; docs/certified.md has the proof."""

from __future__ import annotations

from math import sqrt

import numpy as np

from companion.avoidance.certified.margins import between, fastest, further, sideways
from companion.config import CompanionConfig
from companion.errors import CompanionError
from companion.values.horizon import Array

_FLAT = 0.1
"""Height of the box of a plan at a fixed height, in widths."""
_ROUNDING_M = 0.01
"""What speeds and sides of rounded plans may exceed their limits by, as a length (m), at most."""


def plan_sides(config: CompanionConfig) -> Array | None:
    """Return the sides (3,), m, of the box that holds a whole plan; None without ``certified.range``.

    Raises CompanionError if the range leaves no room for plans.
    """
    certified, reach = config.certified, config.certified.range
    if reach is None:
        return None
    field, limits = config.field, config.limits
    margins = 2.0 * sideways(certified, field, limits)
    near = between(certified, field, limits) + 2.0 * further(certified)
    closing = 2.0 * fastest(limits) * 2e-6 * (certified.contact_us + certified.epoch_us)
    least = margins + near + closing + 2.0 * _ROUNDING_M
    if reach <= least:
        raise CompanionError(
            f"certified.range = {reach:g} m leaves no room for plans; more than {least:.3f} m is allowed"
            " with this d_min, margin, drift, v_max, contact_us and epoch_us"
        )
    shape = np.array([1.0, 1.0, _FLAT if config.planar else 1.0])
    sides: Array = 0.5 * (reach - least) / sqrt(float(shape @ shape)) * shape
    return sides
