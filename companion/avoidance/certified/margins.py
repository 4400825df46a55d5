"""Distances that plans must keep, and balls that hold non-cooperative vehicles.

The guarantee is about true positions, and plans differ from them. Each of two vehicles differs by the tube
(its autopilot's tracking error), by k·σ of its position estimate (k: ``certified.sigmas``), and by ‖v_max‖
times the error of its clock.
"""

from __future__ import annotations

from functools import partial
from math import inf, sqrt

import numpy as np

from companion.config.certified import CertifiedConfig
from companion.config.planning import FieldConfig, LimitsConfig
from companion.estimation.turn_rate import turning_path
from companion.values.horizon import Array

_ARC = 1.0 / 24.0
"""Bound of the distance of an arc from the quadratic curve with its ends, as a share of v ω² dt³."""


def fastest(limits: LimitsConfig) -> float:
    """Return the largest speed of a plan, m/s: the norm of the largest speeds of its axes."""
    return sqrt(sum(v * v for v in limits.fastest))


def margin(config: CertifiedConfig, field: FieldConfig, limits: LimitsConfig) -> float:
    """Return by how much (m) a vehicle's true position may differ from its plan: tube, k·σ, clock."""
    return _strays(config, limits) + config.sigmas * field.position_sigma


def sideways(config: CertifiedConfig, field: FieldConfig, limits: LimitsConfig) -> float:
    """Return by how much (m) a vehicle's true place may differ from its plan horizontally.

    That holds also while its autopilot takes it off or lands it.
    """
    return margin(config, field, limits) + further(config)


def between(config: CertifiedConfig, field: FieldConfig, limits: LimitsConfig) -> float:
    """Return the least distance (m) between two plans: d_min and the deviations of both.

    Each estimate may be off by k·σ, in opposite directions.
    """
    return field.d_min + 2.0 * margin(config, field, limits)


def from_surfaces(config: CertifiedConfig, field: FieldConfig, limits: LimitsConfig) -> float:
    """Return the least distance (m) of a plan from the surfaces of fixed obstacles."""
    least = field.d_min if config.d_min_obstacle is None else config.d_min_obstacle
    return least + margin(config, field, limits)


def further(config: CertifiedConfig) -> float:
    """Return by how much further (m) than from a plan in space others keep from a column.

    A vehicle that its autopilot takes off or lands is within ``certified.drift`` of the axis, otherwise
    within the tube of its plan.
    """
    return max(0.0, config.drift - config.tube)


def beside(config: CertifiedConfig, field: FieldConfig, limits: LimitsConfig) -> float:
    """Return how far (m) from the end of its plan a vehicle at rest there may report its position.

    The position estimate at the time of the plan and the reported estimate may both be off by k·σ.
    """
    return _strays(config, limits) + 2.0 * config.sigmas * field.position_sigma


def _strays(config: CertifiedConfig, limits: LimitsConfig) -> float:
    """Return by how much (m) a vehicle's estimated position may differ from its plan: tube and clock."""
    return config.tube + 1e-6 * config.clock_us * fastest(limits)


def reachable(
    position: Array,
    velocity: Array,
    age: float,
    seconds: Array,
    speed: float,
    acceleration: float,
    growth: float = inf,
    turn_rate: float = 0.0,
) -> tuple[Array, Array]:
    """Return balls that hold a non-cooperative vehicle: centres (n, 3, 3) and radii (n,), m.

    The vehicle flies at ``speed`` (m/s) and with ``acceleration`` (m/s²) at most. The centres are those at
    the control points of n segments, the radii those at the segments' ends. The vehicle was at ``position``
    (3,), m, with ``velocity`` (3,), m/s, ``age`` seconds before time 0 of ``seconds`` (n + 1,), the knots.
    Two balls hold it: one about its last position, one about the position at constant velocity; the smaller
    one is returned. From the first knot at or after ``growth`` (s) on the vehicle is assumed to have
    ``velocity`` again: the ball keeps its radius and moves on. With a ``turn_rate`` (rad/s, counter-clockwise
    from above) the velocity turns, and ``acceleration`` bounds the rest of the vehicle's acceleration.
    """
    later = age + seconds
    begin, end = later[:-1], later[1:]
    until = later[min(int(np.searchsorted(seconds, growth - 1e-9)), len(end))]
    bounded = np.minimum(end, until)
    stays, goes_on = speed * bounded, 0.5 * acceleration * bounded**2
    flies = goes_on < stays
    times = np.stack([begin, 0.5 * (begin + end), end], axis=1)
    moved = np.where(flies[:, None], times, np.maximum(times - until, 0.0))
    radii = np.where(flies, goes_on, stays)
    if turn_rate == 0.0:
        return position + moved[:, :, None] * velocity, radii
    began = np.where(flies, 0.0, until)
    path = partial(turning_path, position, velocity, turn_rate)
    (starts, before), (ends, after) = path(moved[:, 0] + began), path(moved[:, 2] + began)
    length = (moved[:, 2] - moved[:, 0])[:, None]
    middles = 0.5 * (starts + ends) + 0.25 * length * (before - after)
    centres = position + np.stack([starts, middles, ends], axis=1) - path(began).positions[:, None]
    # An arc is not quadratic.
    return centres, radii + _ARC * float(np.linalg.norm(velocity)) * turn_rate**2 * length[:, 0] ** 3
