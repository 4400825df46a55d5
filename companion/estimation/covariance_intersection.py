"""Covariance intersection of two estimates of a place, as a part of the fusion filter.

The result has the information ω P⁻¹ + (1 − ω) R⁻¹. Its covariance is not too small, whatever the correlation
of the two is (S. J. Julier, J. K. Uhlmann, A non-divergent estimation algorithm in the presence of unknown
correlations, ACC 1997).
"""

from __future__ import annotations

import numpy as np

from companion.estimation.symmetric_inverse import inverse
from companion.values.compiled import part
from companion.values.horizon import Array

_GAIN = 0.999
"""An estimate by others is used if it lowers the trace to less than this share."""


@part
def _own_share(P: Array, R: Array) -> float:
    """Return ω of the covariance intersection of two estimates of a place.

    It minimises the trace of (ω P⁻¹ + (1 − ω) R⁻¹)⁻¹, to 2 %; 1: the other estimate adds nothing. ``P``,
    ``R``: covariances, m²; the first (3, 3) of each are those of the place.
    """
    A, B, C, D = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    inverse(P, A)
    inverse(R, B)
    best, least = 1.0, P[0, 0] + P[1, 1] + P[2, 2]
    for k in range(1, 50):
        share = 0.02 * k
        for i in range(3):
            for j in range(3):
                C[i, j] = share * A[i, j] + (1.0 - share) * B[i, j]
        inverse(C, D)
        trace = D[0, 0] + D[1, 1] + D[2, 2]
        if trace < _GAIN * least:
            best, least = share, trace
    return best


@part
def intersect(P: Array, R: Array, B: Array, S: Array) -> bool:
    """Divide ``P`` (n, n) and its first columns ``B`` (n, 3) by ω; write the innovation's covariance ``S``.

    P/ω and R/(1 − ω) are combined as if they were independent; ``R``, ``S`` (3, 3): ``R`` is the covariance
    of the other place. Return False, with nothing changed, if the other estimate adds nothing.
    """
    n, share = len(P), _own_share(P, R)
    if share == 1.0:
        return False
    for j in range(n):
        for k in range(n):
            P[j, k] /= share
    for j in range(n):
        for a in range(3):
            B[j, a] /= share
    for a in range(3):
        for b in range(3):
            S[a, b] = B[a, b] + R[a, b] / (1.0 - share)
    return True
