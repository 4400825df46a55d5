"""Rates and quantiles with 95 % intervals that assume nothing about the distribution of the values.

Rates: Wilson's score interval (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927). Quantiles: order statistics; two
values of the sample enclose the true quantile with a probability that the binomial distribution gives (H. A.
David and H. N. Nagaraja, Order Statistics, 3rd ed., Sec. 7.1). No random numbers are drawn, so the same runs
give the same intervals. Values may be +inf: a run that never converged took longer than every run that did.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, inf, isfinite, lgamma, log, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Z_95 = 1.959963984540054
"""Standard normal quantile of 0.975."""
CONFIDENCE = 0.95


class Interval(NamedTuple):
    """Interval with ``low`` ≤ ``value`` ≤ ``high``.

    A bound of a quantile is -inf or +inf if the sample is too small for a finite one.
    """

    value: float
    low: float
    high: float


def rate(successes: int, trials: int) -> Interval | None:
    """Return the share of ``successes`` with Wilson's 95 % interval; None without trials.

    Raises ValueError if there are more successes than trials, or fewer than 0.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"{successes} successes of {trials} trials")
    if trials == 0:
        return None
    share, z2 = successes / trials, Z_95**2
    centre = (share + z2 / (2 * trials)) / (1 + z2 / trials)
    half = Z_95 / (1 + z2 / trials) * sqrt(share * (1 - share) / trials + z2 / (4 * trials**2))
    # At 0 and 1 the interval must close exactly, without rounding errors.
    low = 0.0 if successes == 0 else centre - half
    high = 1.0 if successes == trials else centre + half
    return Interval(share, low, high)


def quantile(values: Sequence[float], level: float) -> Interval | None:
    """Return the quantile of ``values`` at ``level`` with a 95 % interval; None without values.

    The quantile is the least value that at least a share ``level`` of the sample does not exceed; the bounds
    are values of the sample, or infinite. Raises ValueError if ``level`` is not between 0 and 1.
    """
    if not 0.0 < level < 1.0:
        raise ValueError(f"level {level} is not between 0 and 1")
    ordered = sorted(values)
    count = len(ordered)
    if count == 0:
        return None
    # Subtracted because of rounding: 0.55 · 100 is 55.00000000000001 in floats, and its rank is 55.
    middle = ordered[max(1, ceil(level * count - 1e-9)) - 1]
    lower, upper = ranks(count, level)
    low = ordered[lower - 1] if lower >= 1 else -inf
    high = ordered[upper - 1] if upper <= count else inf
    return Interval(middle, low, high)


def ranks(count: int, level: float) -> tuple[int, int]:
    """Return the ranks (l, u), counted from 1, that bound the quantile of a sample of ``count`` values.

    The true quantile is below x(l) with a probability of at most 2.5 %, and above x(u) likewise. l is 0, and
    u is ``count`` + 1, if no rank achieves that.
    """
    # x(l) > quantile ⟺ fewer than l values are at or below it; their number is binomially distributed.
    below = np.concatenate([[0.0], np.cumsum(_binomial(count, level))])
    tail = (1.0 - CONFIDENCE) / 2
    lower = int(np.searchsorted(below[: count + 1], tail, side="right")) - 1
    upper = int(np.searchsorted(below, 1.0 - tail, side="left"))
    return max(lower, 0), min(upper, count + 1)


def least(values: Sequence[float]) -> float | None:
    """Return the smallest finite value; None if there is none."""
    return min((value for value in values if isfinite(value)), default=None)


def largest(values: Sequence[float]) -> float | None:
    """Return the largest finite value; None if there is none."""
    return max((value for value in values if isfinite(value)), default=None)


def plain(values: Sequence[float], level: float) -> float | None:
    """Return the quantile alone; None if there are no values or it is not finite."""
    found = quantile(values, level)
    return None if found is None or not isfinite(found.value) else found.value


def _binomial(count: int, probability: float) -> NDArray[np.float64]:
    """Return the probabilities (count + 1,) of 0…count successes, by logarithms to avoid overflow."""
    k = np.arange(count + 1)
    choose = np.array([lgamma(count + 1) - lgamma(i + 1) - lgamma(count - i + 1) for i in range(count + 1)])
    return np.asarray(np.exp(choose + k * log(probability) + (count - k) * log(1.0 - probability)))
