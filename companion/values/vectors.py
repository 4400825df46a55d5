"""Vectors, many at once."""

from __future__ import annotations

import numpy as np

from companion.values.horizon import Array


def limit(force: Array, bound: float) -> Array:
    """The same directions with norms of at most ``bound``: rows (…, 3)."""
    norm = np.sqrt(np.vecdot(force, force))
    scale = bound / np.maximum(norm, bound)
    limited: Array = force * scale[..., None]
    return limited
