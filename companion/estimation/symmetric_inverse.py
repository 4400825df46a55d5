"""Inverse of a symmetric matrix (3, 3), as a part of kernels."""

from __future__ import annotations

from companion.values.compiled import part
from companion.values.horizon import Array


@part
def inverse(S: Array, out: Array) -> None:
    """Write the inverse of the symmetric ``S`` (3, 3) to ``out``."""
    a, b, c = S[0, 0], S[0, 1], S[0, 2]
    d, e, f = S[1, 1], S[1, 2], S[2, 2]
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    scale = 1.0 / (a * A + b * B + c * C)
    out[0, 0], out[0, 1], out[0, 2] = A * scale, B * scale, C * scale
    out[1, 0], out[1, 1], out[1, 2] = B * scale, (a * f - c * c) * scale, (b * c - a * e) * scale
    out[2, 0], out[2, 1], out[2, 2] = C * scale, (b * c - a * e) * scale, (a * d - b * b) * scale
