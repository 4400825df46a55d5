"""How far apart plans have to be, and where those may be that share none.

The promise is about true places; what is planned differs from them. Between two vehicles each differs by the
tube (its autopilot's tracking error), by k·σ of its estimate, and by v_max times the error of its clock.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from companion.config.certified import CertifiedConfig
from companion.config.planning import FieldConfig, LimitsConfig
from companion.values.horizon import Array


def fastest(limits: LimitsConfig) -> float:
    """The largest speed, m/s, of a plan that goes as fast as it may on each axis."""
    return sqrt(sum(v * v for v in limits.v_max))


def margin(config: CertifiedConfig, field: FieldConfig, limits: LimitsConfig) -> float:
    """By how much (m) one vehicle's true place may differ from its plan: tube, k·σ, clock."""
    return _strays(config, limits) + config.sigmas * field.position_sigma


def between(config: CertifiedConfig, field: FieldConfig, limits: LimitsConfig) -> float:
    """Least distance (m) between two plans: d_min and what both differ by. The errors of two estimates are
    independent, so they add as squares."""
    strays = 2.0 * _strays(config, limits)
    return field.d_min + strays + sqrt(2.0) * config.sigmas * field.position_sigma


def beside(config: CertifiedConfig, field: FieldConfig, limits: LimitsConfig) -> float:
    """How far (m) beside its plan one may say that it is, long after it stopped there, that has not moved
    since: its estimate then and its estimate now are both off."""
    return _strays(config, limits) + sqrt(2.0) * config.sigmas * field.position_sigma


def _strays(config: CertifiedConfig, limits: LimitsConfig) -> float:
    """By how much (m) where a vehicle believes that it is may differ from its plan: tube and clock."""
    return config.tube + 1e-6 * config.clock_us * fastest(limits)


def stranger(
    position: Array, velocity: Array, age: float, seconds: Array, speed: float, acceleration: float
) -> tuple[Array, Array]:
    """Balls that hold one that flies as it likes, at most at ``speed`` (m/s) and with ``acceleration``
    (m/s²): centres (n, 3, 3) at the control points of n segments and radii (n,), m.

    It was at ``position`` (3,) with ``velocity`` (3,) ``age`` seconds before the first of n + 1 knots, which
    are at ``seconds`` (n + 1,). Two balls hold it, one about where it was, one about where it would be if it
    flew on; the smaller counts.
    """
    later = age + seconds
    begin, end = later[:-1], later[1:]
    stays = speed * end
    goes_on = 0.5 * acceleration * end**2
    flies = goes_on < stays
    moved = np.stack([begin, 0.5 * (begin + end), end], axis=1) * flies[:, None]
    centres = position + moved[:, :, None] * velocity
    return centres, np.where(flies, goes_on, stays)
