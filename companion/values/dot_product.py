"""Scalar product of two vectors in space, as a part of kernels."""

from __future__ import annotations

from companion.values.compiled import part
from companion.values.horizon import Array


@part
def dot(a: Array, b: Array) -> float:
    """Return the scalar product of two vectors (3,)."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
