"""Dryden turbulence at low altitude, after MIL-F-8785C (3.7.1.2 the Dryden form, 3.7.3 its scales).

    Φ_u(Ω) = σ_u² 2L_u/π · 1/(1 + (L_u Ω)²)
    Φ_v(Ω) = σ_v² L_v/π · (1 + 3(L_v Ω)²)/(1 + (L_v Ω)²)²         w likewise, with L_w and σ_w

    L_w = h, L_u = L_v = h/(0.177 + 0.000823 h)^1.2               h in feet, from 10 to 1000
    σ_w = 0.1 W20, σ_u = σ_v = σ_w/(0.177 + 0.000823 h)^0.4       W20: wind at 20 feet

Φ is the spectrum over the spatial frequency Ω (rad per unit of length), σ a standard deviation, L a length; u
is along the wind, v across it, w vertical. The field is frozen and passes the vehicle with the vehicle's
airspeed (Taylor), or with W20 if W20 is greater: the wind W20, which causes this turbulence, also carries it
past a hovering vehicle.
"""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

import numpy as np

from mavlink_bridge.messages import Vector
from sitl.environment.noise import one_pole, two_poles

Severity = Literal["none", "light", "moderate", "severe"]

W20: Final[dict[Severity, float]] = {"none": 0.0, "light": 7.717, "moderate": 15.433, "severe": 23.150}
"""Wind at 20 feet (m/s): 15, 30 and 45 knots."""

PERIOD: Final = 10_000
"""Time between samples (µs)."""

_DT: Final = PERIOD * 1e-6
_FOOT: Final = 0.3048
_MIN_HEIGHT_FT, _MAX_HEIGHT_FT = 10.0, 1000.0
_SAMPLES_PER_DRAW: Final = 100
# The numerator 1 + √3 L/V s turns a state of variance one into an output of variance 4.
_SQRT_3: Final = math.sqrt(3.0)


class Scales(NamedTuple):
    """Lengths (m) and standard deviations (m/s) along and across the wind (``horizontal``), and vertical."""

    horizontal_length: float
    vertical_length: float
    horizontal: float
    vertical: float


def scales(height: float, w20: float) -> Scales:
    """Return the scales at ``height`` (m above the ground, clipped to 10…1000 feet) for ``w20`` (m/s).

    Source: MIL-F-8785C 3.7.3.
    """
    feet = min(max(height / _FOOT, _MIN_HEIGHT_FT), _MAX_HEIGHT_FT)
    base = 0.177 + 0.000823 * feet
    vertical = 0.1 * w20
    return Scales(feet / base**1.2 * _FOOT, feet * _FOOT, vertical / base**0.4, vertical)


class Turbulence:
    """Gusts along the wind, across it to the right, and down: ``components`` (m/s).

    They change every ``PERIOD``. The filters' states have variance one, so that the output always has the
    variance of the present height, even if height and speed have changed.
    """

    def __init__(self, w20: float, random: np.random.Generator) -> None:
        """Start in the steady state at time 0."""
        self._w20 = w20
        self._random = random
        self._along, v0, v1, w0, w1 = random.standard_normal(5).tolist()
        self._across, self._down = (v0, v1), (w0, w1)
        self._draws: list[list[float]] = []
        self._sample = 0
        self.components: Vector = self._output(scales(0.0, w20))

    def advance(self, now: int, height: float, airspeed: float) -> None:
        """Advance to ``now`` (µs, not decreasing), at ``height`` m above ground and ``airspeed`` (m/s)."""
        samples = now // PERIOD - self._sample
        if samples <= 0:
            return
        self._sample += samples
        size = scales(height, self._w20)
        shift = max(airspeed, self._w20) * _DT
        keep, gain = one_pole(shift / size.horizontal_length)
        flat = two_poles(shift / size.horizontal_length, shift / size.horizontal_length)
        steep = two_poles(shift / size.vertical_length, shift / size.vertical_length)
        for _ in range(samples):
            if not self._draws:
                self._draws = self._random.standard_normal((_SAMPLES_PER_DRAW, 5)).tolist()[::-1]
            a, b, c, d, e = self._draws.pop()
            self._along = keep * self._along + gain * a
            self._across = flat.step(*self._across, b, c)
            self._down = steep.step(*self._down, d, e)
        self.components = self._output(size)

    def _output(self, size: Scales) -> Vector:
        (v, dv), (w, dw) = self._across, self._down
        return (
            size.horizontal * self._along,
            0.5 * size.horizontal * (v + _SQRT_3 * dv),
            0.5 * size.vertical * (w + _SQRT_3 * dw),
        )
