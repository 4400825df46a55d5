"""Fading of a method's force, by shares in 0…1, with 1 for the whole force.

Deviation from the paper, which has no limit: a vehicle that already moves fast in the direction of a force is
not made faster. The force is whole up to half of the speed at which it is gone.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from companion.values.horizon import Array

_Number = TypeVar("_Number", float, Array)


def shares(x: Array) -> Array:
    """Return ``x`` clipped to 0…1; ``np.clip`` costs four times as much for arrays as small as these."""
    result: Array = np.minimum(np.maximum(x, 0.0), 1.0)
    return result


def reserve(speed: _Number, gone: float) -> _Number:
    """Return 1 at half of the speed ``gone`` and 0 at ``gone``.

    Clipped to 0…1, it is the share of the force: whole up to half of ``gone``, and none from ``gone`` on.
    """
    return 2.0 * (1.0 - speed / gone)
