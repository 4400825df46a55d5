"""Which samples the page shows: 25 a second, or fewer where that would be too much. What is least or most
between two of them is kept."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from outrider.report.run import Array, Motions

PERIOD = 0.04
"""s between samples on the page."""
MOST = 60_000
"""Samples of single vehicles: two minutes of twenty at 25 Hz, some 2.5 MB of page."""


def chosen(motions: Motions) -> NDArray[np.intp]:
    """Indices (n,) of the samples that are shown; the last is always one of them."""
    count = len(motions.time)
    span = float(motions.time[-1] - motions.time[0])
    usual = span / (count - 1) if count > 1 else PERIOD
    stride = max(1, round(PERIOD / usual), math.ceil(count * max(1, len(motions.system)) / MOST))
    return np.arange(count - 1, -1, -stride)[::-1]


def least(values: Array, indices: NDArray[np.intp]) -> Array:
    """Of ``values`` (T, …) the least (n, …) since the sample shown before; NaN where none is finite."""
    begins = np.concatenate([[0], indices[:-1] + 1])
    result: Array = np.fmin.reduceat(np.where(np.isfinite(values), values, np.nan), begins, axis=0)
    return result


def largest(time: Array, values: Array, shown: Array) -> Array:
    """Of ``values`` (m,) at ``time`` (m,) s the largest (n,) since the time ``shown`` (n,) before; NaN where
    there is none."""
    result = np.full(len(shown), np.nan)
    place = np.searchsorted(shown, time, side="left")
    fits = (place < len(shown)) & np.isfinite(values)
    np.fmax.at(result, place[fits], values[fits])
    return result
