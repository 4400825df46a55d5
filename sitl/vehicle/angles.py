"""Cosine and sine by arithmetic alone: the same bits for one vehicle and for a block."""

from __future__ import annotations

import math

from sitl.vehicle.compiled import kernel
from sitl.vehicle.simd import nearest
from sitl.vehicle.vectors import greatest, least

_TURNS = 0.5 / math.pi
# 2π to 37 bits, so that its product with up to 65 000 turns is exact, and the remainder.
_TURN = 6.283185307169333
_TURN_REST = 1.0253376606378076e-11

# Taylor: (−1)^k / (2k)! and (−1)^k / (2k + 1)!
_C2, _C4, _C6, _C8 = -1.0 / 2, 1.0 / 24, -1.0 / 720, 1.0 / 40_320
_C10, _C12, _C14, _C16 = -1.0 / 3_628_800, 1.0 / 479_001_600, -1.0 / 87_178_291_200, 1.0 / 20_922_789_888_000
_S3, _S5, _S7, _S9 = -1.0 / 6, 1.0 / 120, -1.0 / 5_040, 1.0 / 362_880
_S11, _S13, _S15 = -1.0 / 39_916_800, 1.0 / 6_227_020_800, -1.0 / 1_307_674_368_000


@kernel
def small_cosine_sinc(square: float) -> tuple[float, float]:
    """Return cos x and sin x / x from x², exact to the last bit where x² < 0.01."""
    c = 1.0 + square * (_C2 + square * (_C4 + square * (_C6 + square * _C8)))
    s = 1.0 + square * (_S3 + square * (_S5 + square * (_S7 + square * _S9)))
    return c, s


@kernel
def cosine_sine(angle: float) -> tuple[float, float]:
    """Return cos and sin of an angle (rad), within 3e-15 up to 65 000 turns; beyond they are merely finite.

    It evaluates the series of a quarter of the angle, at most 45°, and doubles the angle twice.
    """
    turns = nearest(_TURNS * angle)
    rest = angle - turns * _TURN - turns * _TURN_REST
    x = 0.25 * greatest(-math.pi, least(math.pi, rest))
    z = x * x
    c = _C8 + z * (_C10 + z * (_C12 + z * (_C14 + z * _C16)))
    c = 1.0 + z * (_C2 + z * (_C4 + z * (_C6 + z * c)))
    s = _S7 + z * (_S9 + z * (_S11 + z * (_S13 + z * _S15)))
    s = x * (1.0 + z * (_S3 + z * (_S5 + z * s)))
    c, s = c * c - s * s, 2.0 * c * s
    return c * c - s * s, 2.0 * c * s
