"""Double integrators that fly to their goals with the velocities of an avoidance method.

The method receives the true positions and velocities of all at every step and without delay, which is better
than with the project's radio, sensors and vehicles.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np

from outrider.scenarios.starts import Array
from outrider.simulation.conductor import HOLD, NEAR, SLOW

STEP = 0.01
"""Time (s) between two choices of a velocity: the period of a companion's plans."""
A_MAX, V_MAX = 2.0, 5.0
"""Limits of acceleration (m/s²) and speed (m/s), of the norm: the paper's limits of an axis."""
_STRAIGHT = 1.0
"""Distance (m) from the goal within which the preferred velocity is not turned."""

_TOUCH = 1e-3
"""Tolerance (m) below d_min: ORCA aims at touching, and computes in single precision."""


class FreeMotion(NamedTuple):
    """Motion of a vehicle without neighbours.

    ``braking``: m/s² before the goal, less than `A_MAX` to leave some for avoidance; ``gain``: 1/s, speed per
    metre of distance close to the goal; ``turned``: rad to the right of the direct path, so that vehicles
    that meet pass each other on the same side.
    """

    braking: float
    gain: float
    turned: float


class Avoidance(Protocol):
    """Interface of an avoidance method, which chooses velocities."""

    def velocities(self, positions: Array, velocities: Array, preferred: Array) -> Array:
        """Return velocities (K, 2), m/s, not faster than `V_MAX`.

        The arguments are the positions (K, 2), m, the velocities (K, 2), m/s, and the preferred velocities,
        with which each vehicle would move without neighbours.
        """
        ...


class Flown(NamedTuple):
    """Result of a flight.

    ``converged_s``: time since which all vehicles were at rest at their goals, None if never;
    ``separation_m``: least of any pair; ``below_s``: time for which some pair was closer than ``d_min`` by
    more than the tolerance.
    """

    converged_s: float | None
    separation_m: float
    below_s: float


def fly(
    starts: Array, goals: Array, avoidance: Avoidance, manner: FreeMotion, d_min: float, cap_s: float
) -> Flown:
    """Fly from ``starts``, at rest, to ``goals`` (K, 2), m.

    Convergence follows the rule of ``outrider``. The flight ends with it, or after ``cap_s``.
    """
    position, velocity = starts.copy(), np.zeros_like(starts)
    pairs = np.triu_indices(len(starts), 1)
    least, below, arrived = math.inf, 0, None
    for step in range(round(cap_s / STEP)):
        chosen = avoidance.velocities(position, velocity, preferred(goals - position, manner))
        acceleration = clipped((chosen - velocity) / STEP, A_MAX)
        before = position
        position = position + STEP * velocity + 0.5 * STEP**2 * acceleration
        velocity = velocity + STEP * acceleration
        separation = nearest(before[pairs[0]] - before[pairs[1]], position[pairs[0]] - position[pairs[1]])
        least = min(least, separation)
        below += separation < d_min - _TOUCH
        if not at_rest(goals - position, velocity):
            arrived = None
            continue
        arrived = step + 1 if arrived is None else arrived
        if (step + 1 - arrived) * STEP >= HOLD * 1e-6:
            return Flown(round(arrived * STEP, 2), least, below * STEP)
    return Flown(None, least, below * STEP)


def preferred(way: Array, manner: FreeMotion) -> Array:
    """Return velocities (K, 2), m/s, with which each would come to rest at the end of its ``way`` (K, 2), m.

    v = √(2 b (d − d₀)) far away and k d near, which meet where d = 2 d₀ = b / k² with one slope: the
    deceleration never exceeds b.
    """
    distance = np.linalg.norm(way, axis=1)
    bend = manner.braking / manner.gain**2
    far = np.sqrt(2.0 * manner.braking * np.maximum(distance - 0.5 * bend, 0.0))
    speed = np.minimum(np.where(distance < bend, manner.gain * distance, far), V_MAX)
    angle = np.where(distance > _STRAIGHT, -manner.turned, 0.0)
    cos, sin = np.cos(angle), np.sin(angle)
    aside = np.column_stack([cos * way[:, 0] - sin * way[:, 1], sin * way[:, 0] + cos * way[:, 1]])
    return np.asarray(aside * (speed / np.maximum(distance, 1e-9))[:, None])


def clipped(vectors: Array, most: float) -> Array:
    """Return vectors (K, 2), none longer than ``most``."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors * np.minimum(1.0, most / np.maximum(lengths, 1e-12)))


def nearest(before: Array, after: Array) -> float:
    """Return the least distance, m, of pairs during a step.

    ``before`` and ``after`` are the relative positions (P, 2), m, at its ends; in between they move straight.
    At a closing speed of 10 m/s a step is 0.1 m.
    """
    move = after - before
    square = np.maximum(np.einsum("ij,ij->i", move, move), 1e-18)
    share = np.clip(-np.einsum("ij,ij->i", before, move) / square, 0.0, 1.0)
    return float(np.linalg.norm(before + share[:, None] * move, axis=1).min(initial=math.inf))


def at_rest(way: Array, velocity: Array) -> bool:
    """Return whether all are at their goals, and slow."""
    return bool(
        (np.linalg.norm(way, axis=1) < NEAR).all() and (np.linalg.norm(velocity, axis=1) < SLOW).all()
    )
