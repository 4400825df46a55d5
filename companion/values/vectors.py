"""Operations on many vectors at once."""

from __future__ import annotations

import numpy as np

from companion.values.horizon import Array


def limit(force: Array, bound: float) -> Array:
    """Return vectors (…, 3) in the directions of ``force`` with norms of at most ``bound``."""
    norm = np.sqrt(np.vecdot(force, force))
    scale = bound / np.maximum(norm, bound)
    limited: Array = force * scale[..., None]
    return limited


def clipped(vector: Array, least: Array, most: Array) -> Array:
    """Return ``vector`` with each component clipped to those of ``least`` and ``most``."""
    return np.minimum(np.maximum(vector, least), most)
