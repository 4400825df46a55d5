"""Parts of the firmwares' control laws: the square-root law, and limits of vector length."""

from __future__ import annotations

import math

Pair = tuple[float, float]
"""Horizontal vector: north, east."""


def square_root_law(error: float, gain: float, limit: float, dt: float = 0.0) -> float:
    """Return the rate that closes ``error`` by the square-root law.

    The rate is proportional (``gain``, 1/s) to errors up to e₀ = limit/gain², and √(2·limit·(|e| − e₀/2))
    beyond, so that it changes no faster than ``limit``. With ``dt`` (s) it never overshoots within one step.
    """
    near = limit / (gain * gain)
    size = abs(error)
    rate = gain * size if size <= near else math.sqrt(2.0 * limit * (size - 0.5 * near))
    if dt > 0.0:
        rate = min(rate, size / dt)
    return math.copysign(rate, error)


def inverse_square_root_law(rate: float, gain: float, limit: float) -> float:
    """Return the error for which the square-root law gives ``rate`` (not negative)."""
    if rate <= limit / gain:
        return rate / gain
    return 0.5 * limit / (gain * gain) + rate * rate / (2.0 * limit)


def directed(error: Pair, gain: float, limit: float, dt: float = 0.0) -> Pair:
    """Return the rate that closes a horizontal ``error`` by the square-root law, along that error."""
    size = math.hypot(*error)
    if size < 1e-12:
        return 0.0, 0.0
    factor = square_root_law(size, gain, limit, dt) / size
    return error[0] * factor, error[1] * factor


def cut(vector: Pair, limit: float) -> Pair:
    """Return ``vector``, shortened to the length ``limit`` if it is longer."""
    size = math.hypot(*vector)
    if size <= limit:
        return vector
    return vector[0] * limit / size, vector[1] * limit / size


def split(vector: Pair, along: Pair) -> tuple[float, Pair, Pair]:
    """Return the part of ``vector`` along the direction of ``along``, the part across it, and that direction.

    If ``along`` is near zero, all of ``vector`` is across.
    """
    size = math.hypot(*along)
    if size < 1e-9:
        return 0.0, vector, (0.0, 0.0)
    x, y = along[0] / size, along[1] / size
    part = vector[0] * x + vector[1] * y
    return part, (vector[0] - part * x, vector[1] - part * y), (x, y)


def joined(part: float, across: Pair, direction: Pair) -> Pair:
    """Return the vector that ``split`` has taken apart."""
    return across[0] + part * direction[0], across[1] + part * direction[1]


def same_way(a: Pair, b: Pair) -> bool:
    """Return whether two vectors have a positive scalar product."""
    return a[0] * b[0] + a[1] * b[1] > 0.0
