"""Ways for whatever goes along one."""

from __future__ import annotations

import numpy as np


def bent_ring(count: int, seed: int) -> np.ndarray:
    """Places on a ring of 10 m, each moved by decimetres: no two coincide."""
    angle = 2.0 * np.pi * np.arange(count) / count
    ring = np.column_stack([10.0 * np.cos(angle), 10.0 * np.sin(angle), np.full(count, 1.0)])
    return ring + np.random.default_rng(seed).uniform(-0.5, 0.5, (count, 3))
