"""Vectors with their first two time derivatives."""

from __future__ import annotations

from sitl.vehicle.compiled import kernel
from sitl.vehicle.vectors import Vector, cross, dot, norm, plus, times

WithRates = tuple[Vector, Vector, Vector]
"""A vector and its first two derivatives."""


@kernel
def unit_with_rates(x: WithRates) -> WithRates:
    """Return u = x/‖x‖ with its first two derivatives, from those of x."""
    s = 1.0 / norm(x[0])
    u, a, b = times(s, x[0]), times(s, x[1]), times(s, x[2])
    growth = dot(u, a)
    du = plus(a, -growth, u)
    ddu = plus(plus(b, -2.0 * growth, du), -dot(u, b) - dot(du, du), u)
    return u, du, ddu


@kernel
def across_with_rates(x: WithRates, u: WithRates) -> WithRates:
    """Return the part of x normal to a unit vector u, x − (u·x) u, with its first two derivatives."""
    along = dot(u[0], x[0])
    dalong = dot(u[1], x[0]) + dot(u[0], x[1])
    ddalong = dot(u[2], x[0]) + 2.0 * dot(u[1], x[1]) + dot(u[0], x[2])
    return (
        plus(x[0], -along, u[0]),
        plus(plus(x[1], -along, u[1]), -dalong, u[0]),
        plus(plus(plus(x[2], -along, u[2]), -2.0 * dalong, u[1]), -ddalong, u[0]),
    )


@kernel
def cross_with_rates(a: WithRates, b: WithRates) -> WithRates:
    """Return a×b with its first two derivatives, from those of both."""
    return (
        cross(a[0], b[0]),
        plus(cross(a[1], b[0]), 1.0, cross(a[0], b[1])),
        plus(plus(cross(a[2], b[0]), 2.0, cross(a[1], b[1])), 1.0, cross(a[0], b[2])),
    )
