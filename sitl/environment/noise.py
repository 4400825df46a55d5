"""Random processes on a fixed time grid, discretised exactly.

Variance and correlation are those of the continuous process for any step. Every state has variance one; the
caller scales it. Time constants may therefore change during a run without a change of variance. A step is
z ← F z + G w, with white noise w of variance one and G Gᵀ = I − F Fᵀ.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class OnePole(NamedTuple):
    """One step x ← ``keep`` x + ``gain`` w of a first-order Gauss–Markov process: correlation e^(−|t|/τ)."""

    keep: float
    gain: float


class TwoPoles(NamedTuple):
    """One step of z = (x, ẋ/ω) with the poles −a and −b, ω² = ab; x and ẋ are uncorrelated, and ẋ exists.

    The fields are the elements of F and of the lower triangular G.
    """

    f11: float
    f12: float
    f21: float
    f22: float
    g11: float
    g21: float
    g22: float

    def step(self, x: float, rate: float, first: float, second: float) -> tuple[float, float]:
        """Return the next (x, ẋ/ω), with two independent draws of variance one."""
        return (
            self.f11 * x + self.f12 * rate + self.g11 * first,
            self.f21 * x + self.f22 * rate + self.g21 * first + self.g22 * second,
        )


def one_pole(share: float) -> OnePole:
    """Return the step of a process whose time constant is 1/``share`` steps."""
    return OnePole(math.exp(-share), math.sqrt(-math.expm1(-2.0 * share)))


def two_poles(first: float, second: float) -> TwoPoles:
    """Return the step dt of a process with the poles −a, −b: ``first`` = a·dt > 0, ``second`` = b·dt > 0.

    Equal poles are allowed.
    """
    apart = second - first
    decayed = math.exp(-first)
    # (e^(−first) − e^(−second)) / (second − first), also for (nearly) equal poles.
    slope = decayed * (-math.expm1(-apart) / apart if apart else 1.0)
    omega = math.sqrt(first * second)
    f11, f12 = decayed + first * slope, omega * slope
    f21, f22 = -f12, decayed - second * slope
    # Rounding may leave a tiny negative variance if the state hardly changes in a step.
    g11 = math.sqrt(max(0.0, 1.0 - f11 * f11 - f12 * f12))
    g21 = -(f11 * f21 + f12 * f22) / g11 if g11 else 0.0
    g22 = math.sqrt(max(0.0, 1.0 - f21 * f21 - f22 * f22 - g21 * g21))
    return TwoPoles(f11, f12, f21, f22, g11, g21, g22)
