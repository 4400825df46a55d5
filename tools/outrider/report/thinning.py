"""Selection of the samples shown on the page: 25 per second, or fewer if there would be too many.

``largest`` gives the maxima between two samples.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from outrider.report.run import Array, Motions

PERIOD = 0.04
"""Time (s) between samples on the page."""
MOST = 60_000
"""Largest number of samples times vehicles: two minutes of twenty vehicles at 25 Hz, some 2.5 MB of page."""


def chosen(motions: Motions) -> NDArray[np.intp]:
    """Return the indices (n,) of the samples that are shown; the last sample is always one of them."""
    count = len(motions.time)
    span = float(motions.time[-1] - motions.time[0])
    usual = span / (count - 1) if count > 1 else PERIOD
    stride = max(1, round(PERIOD / usual), math.ceil(count * max(1, len(motions.system)) / MOST))
    return np.arange(count - 1, -1, -stride)[::-1]


def largest(time: Array, values: Array, shown: Array) -> Array:
    """Return the largest (n,) of ``values`` (m,) between each time in ``shown`` (n,) and the one before.

    ``time`` (m,) are the times of the values; all times are s. The result is NaN where there is no value.
    """
    result = np.full(len(shown), np.nan)
    place = np.searchsorted(shown, time, side="left")
    fits = (place < len(shown)) & np.isfinite(values)
    np.fmax.at(result, place[fits], values[fits])
    return result
