"""How a method's force fades in and out: shares in 0…1, 1 for the whole of it.

Settled against the text, which has no limit: who is fast already to where a force points is not made faster
still. The force is whole up to half of the speed at which it is gone.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from companion.values.horizon import Array

_Number = TypeVar("_Number", float, Array)


def share(x: float) -> float:
    """Clipped to 0…1."""
    return min(max(x, 0.0), 1.0)


def shares(x: Array) -> Array:
    """Clipped to 0…1; ``np.clip`` costs four times as much for arrays as small as these."""
    result: Array = np.minimum(np.maximum(x, 0.0), 1.0)
    return result


def reserve(speed: _Number, gone: float) -> _Number:
    """1 at half of the speed ``gone`` and 0 at it: its share is whole up to half, and none from ``gone``
    on."""
    return 2.0 * (1.0 - speed / gone)
