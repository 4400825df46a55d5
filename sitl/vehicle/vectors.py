"""Three-vectors as tuples: compiled code keeps them in registers, whereas small arrays would be allocated."""

from __future__ import annotations

import math

from sitl.vehicle.compiled import kernel
from sitl.vehicle.simd import where

Vector = tuple[float, float, float]
Axes = tuple[Vector, Vector, Vector]
"""Body axes b1, b2, b3 in NED: the columns of R, which takes body coordinates to NED."""


@kernel
def least(a: float, b: float) -> float:
    """Return the smaller number; b if either is NaN."""
    return where(a < b, a, b)


@kernel
def greatest(a: float, b: float) -> float:
    """Return the greater number; b if either is NaN."""
    return where(a > b, a, b)


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Return a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Return a×b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@kernel
def plus(a: Vector, s: float, b: Vector) -> Vector:
    """Return a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@kernel
def times(s: float, a: Vector) -> Vector:
    """Return s a."""
    return (s * a[0], s * a[1], s * a[2])


@kernel
def scaled(a: Vector, b: Vector) -> Vector:
    """Return the product element by element: a diagonal matrix times a vector."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


@kernel
def chosen(condition: bool, a: Vector, b: Vector) -> Vector:
    """Apply ``where`` to vectors."""
    return (where(condition, a[0], b[0]), where(condition, a[1], b[1]), where(condition, a[2], b[2]))


@kernel
def norm(a: Vector) -> float:
    """Return ‖a‖."""
    return math.sqrt(dot(a, a))


@kernel
def to_body(axes: Axes, a: Vector) -> Vector:
    """Return Rᵀa: a vector of NED in body coordinates."""
    return (dot(axes[0], a), dot(axes[1], a), dot(axes[2], a))


@kernel
def to_ned(axes: Axes, a: Vector) -> Vector:
    """Return R a: a body vector in NED."""
    return plus(plus(times(a[0], axes[0]), a[1], axes[1]), a[2], axes[2])
