"""Adaptation of the variance of the target's acceleration to the detections, as parts of the fusion filter.

The variance, one of both horizontal axes and one of the vertical, is e^θ times the configured one. θ has a
normal prior around 0 and follows the innovations y by recursive maximum likelihood with exponential
forgetting. With S = cov y, u = S⁻¹y and the sensitivity D = ∂P/∂θ of the target's covariance, the score is
½(uᵀDu − tr S⁻¹D) and its information ½ tr (S⁻¹D)². In D the target's correlation with the vehicles' errors is
left out. A refused detection counts only if another one that was refused shortly before agrees with it: false
ones do not agree, those of a target that turned do. The σ of the acceleration is at least ``LEAST_SHARE`` of
the configured one, because innovations of a straight walk say nothing of the next corner.
"""

from __future__ import annotations

from math import log

import numpy as np

from companion.values.compiled import part
from companion.values.horizon import Array

LEAST_SHARE = 0.5
"""Least σ of the acceleration, as a share of the configured one."""
_LEAST_THETA = 2.0 * log(LEAST_SHARE)
_PRIOR, _LEAST_INFORMATION = 1.0, 0.25
"""Information of the prior of θ (σ = 1), and what is taken to be known at least, so that steps are small."""
_CONFIRMED_S = 0.5
"""A refused detection says something of the acceleration if the one refused before it, at most this time (s)
earlier, agrees with it."""
AGREE_M, AGREE_M_S = 2.0, 3.0
"""Detections agree if the places differ by at most a length plus a speed times the time between."""


@part
def confirmed(refused: Array, place: Array) -> bool:
    """Return whether a refused detection of a ``place`` agrees with the last one, and remember it.

    ``refused`` (4,): the seconds for which the last one can still be confirmed, and its place, m.
    """
    left, square = refused[0], 0.0
    for a in range(3):
        square += (place[a] - refused[1 + a]) ** 2
        refused[1 + a] = place[a]
    refused[0] = _CONFIRMED_S
    apart = AGREE_M + AGREE_M_S * (_CONFIRMED_S - left)
    agrees: bool = left > 0.0 and square <= apart * apart
    return agrees


@part
def adapted(
    theta: float, known: float, D: Array, u: Array, T: Array, clip: float, keep: float, bound: float
) -> tuple[float, float]:
    """Return θ and its information, ``known``, after what one detection says.

    ``D`` (≥ 3, ≥ 3): sensitivity, first of the place; ``u`` (3,), its square times ``clip``; ``T`` (3, 3):
    S⁻¹; ``keep``: what is left of θ's information; ``bound``: largest θ.
    """
    score, information = 0.0, 0.0
    for a in range(3):
        for b in range(3):
            score += 0.5 * (clip * u[a] * u[b] - T[a, b]) * D[a, b]
            for c in range(3):
                for d in range(3):
                    information += 0.5 * T[a, b] * D[b, c] * T[c, d] * D[d, a]
    known = keep * known + information
    gain = 1.0 / (known + _LEAST_INFORMATION)
    # What is forgotten is replaced by the prior.
    step = gain * (score - theta * (1.0 - keep) * _PRIOR)
    return min(max(theta + step, _LEAST_THETA), bound), known


@part
def correct(D: Array, K: Array) -> None:
    """Change the sensitivity D (m, m) as a detection with the gain K (≥ m, 3) does.

    It is (I − KH) D (I − KH)ᵀ after it, with H that of the place.
    """
    m, L = len(D), np.empty(D.shape)
    for j in range(m):
        for k in range(m):
            L[j, k] = D[j, k] - (K[j, 0] * D[0, k] + K[j, 1] * D[1, k] + K[j, 2] * D[2, k])
    for j in range(m):
        for k in range(m):
            D[j, k] = L[j, k] - (L[j, 0] * K[k, 0] + L[j, 1] * K[k, 1] + L[j, 2] * K[k, 2])
