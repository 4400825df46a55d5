"""Distances that the settings of a fleet promise, worked out without the companion's own margins.

An error in ``companion/avoidance/certified/margins.py`` makes plans come nearer than these.
"""

from __future__ import annotations

from math import hypot

from companion.config import CompanionConfig


def margin(config: CompanionConfig) -> float:
    """Return how far (m) a vehicle may be from its plan: tube, position error, and clock at full speed."""
    certified, limits = config.certified, config.limits
    lowest = [-v for v in limits.v_max] if limits.v_min is None else limits.v_min
    fastest = hypot(*(max(abs(low), abs(high)) for low, high in zip(lowest, limits.v_max, strict=True)))
    estimate = certified.sigmas * config.field.position_sigma
    return certified.tube + estimate + fastest * certified.clock_us / 1_000_000


def of_plans(config: CompanionConfig) -> float:
    """Return the least distance (m) of two plans: both vehicles may be beside theirs, towards each other."""
    return config.field.d_min + margin(config) + margin(config)


def of_surfaces(config: CompanionConfig) -> float:
    """Return the least distance (m) of a plan from fixed obstacles, which are where they are."""
    least = config.certified.d_min_obstacle
    return (config.field.d_min if least is None else least) + margin(config)


def for_column(config: CompanionConfig) -> float:
    """Return what a vehicle adds (m) while its autopilot takes it off or lands it."""
    return max(config.certified.drift, config.certified.tube) - config.certified.tube
