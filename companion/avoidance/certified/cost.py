"""Cost of a certified plan, and its best plan without inequalities.

The cost of a destination at rest weighs the place where the plan comes to rest far more than the places
before. A destination that moves is followed: the weights of the places decrease with time, because the
prediction of the target is good for a second only, and because a plan that has to come to rest 3.5 s ahead
can be near the moving destination at first but not at its end.
"""

from __future__ import annotations

import numpy as np

from companion.config.certified import CertifiedConfig
from companion.values.horizon import Array


class Cost:
    """Quadratic cost of n accelerations of one axis; the axes have the same cost.

    ``places`` (n,), ``fields`` (n,): weights of the places and of the field after each step. ``P`` (n, n):
    its matrix. ``inverse`` (n, n) and ``stopping`` (n,): the best plan without inequalities is
    −inverse·c − stopping·v for the speed v (m/s) at the beginning; it ends at rest. S_x, S_v (n, n): what the
    accelerations add to position and speed after each step.
    """

    def __init__(
        self,
        places: Array,
        fields: Array,
        omega_speed: float,
        omega_jerk: float,
        omega_input: float,
        S_x: Array,
        S_v: Array,
    ) -> None:
        n = len(places)
        self.places, self.fields = places, fields
        self.omega_speed, self.omega_jerk = omega_speed, omega_jerk
        # ``change @ a``: a_k − a_{k−1}; for k = 0 the linear term subtracts the acceleration until then.
        change = np.eye(n) - np.eye(n, k=-1)
        self.P: Array = 2.0 * (
            S_x.T @ (places[:, None] * S_x)
            + omega_speed * S_v.T @ S_v
            + omega_input * np.eye(n)
            + omega_jerk * change.T @ change
        )
        conditions = np.block([[self.P, S_v[-1:].T], [S_v[-1:], np.zeros((1, 1))]])
        inverse = np.linalg.inv(conditions)
        self.inverse: Array = np.ascontiguousarray(inverse[:n, :n])
        self.stopping: Array = np.ascontiguousarray(inverse[:n, n])
        self.gradient_per_metre = 2.0 * float(places.sum())
        """Derivative of the cost by a shift of the whole plan, one metre from all its preferred places."""


def arriving(config: CertifiedConfig, S_x: Array, S_v: Array, *, planar: bool) -> Cost:
    """Return the cost of a destination at rest, of a flight that is ``planar`` or in space."""
    n = len(S_x)
    places = np.full(n, config.omega_place)
    places[-1] = config.omega_end
    fields = np.full(n, config.omega_field)
    chosen = config.for_flight(planar=planar)
    return Cost(places, fields, config.omega_speed, chosen.omega_jerk, chosen.omega_input, S_x, S_v)


def following(config: CertifiedConfig, S_x: Array, S_v: Array, *, planar: bool) -> Cost:
    """Return the cost of a destination that moves, of a flight that is ``planar`` or in space.

    The field moves the places as far as that of a destination at rest moves the places before the end.
    """
    weights, n, dt = config.following, len(S_x), 1e-6 * config.dt_us
    places = weights.omega_place * np.exp(-weights.decay * dt * np.arange(n))
    places[-1] += weights.omega_end
    fields = places * config.omega_field / max(config.omega_place, 1e-6)
    omega_input = config.for_flight(planar=planar).omega_input
    return Cost(places, fields, weights.omega_speed, weights.omega_jerk, omega_input, S_x, S_v)
