"""Figures of a flight with fused detections: errors of the estimates, and quality of the bearings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.config.formation import Perception
from companion.estimation.fusion_log import ROW, Counts
from companion.goals.viewpoints import anisotropy, weight
from outrider.runs.ground_truth import Samples
from outrider.runs.outcome import Outcome
from outrider.scenarios.scenario import Scenario

Array = NDArray[np.float64]


class Estimates(NamedTuple):
    """Estimates of all companions together.

    ``errors`` (n, 3): estimated less true position of the target, m; ``covariances`` (n, 3, 3);
    ``seen_by`` (n,): number of vehicles that see it.
    """

    errors: Array
    covariances: Array
    seen_by: Array

    @property
    def nees(self) -> Array:
        """Squared error (n,) relative to the covariance; 3 on average if that is right."""
        solved = np.linalg.solve(self.covariances, self.errors[..., None])[..., 0]
        result: Array = np.vecdot(self.errors, solved)
        return result


def estimates(flight: Outcome, samples: Samples) -> Estimates:
    """Return the estimates of all companions while the clock ran; ``samples``: of that time."""
    rows = [*_rows(flight, samples)] or [np.empty((0, ROW))]
    found = np.concatenate(rows)
    return Estimates(found[:, :3], found[:, 3:12].reshape(-1, 3, 3), found[:, 12])


def _rows(flight: Outcome, samples: Samples) -> Iterator[Array]:
    """Yield for each companion its rows in the time of ``samples``, with errors instead of positions."""
    if not len(samples.time):
        return
    first, last = samples.time[0], samples.time[-1]
    for _, after in flight.tallies[: flight.scenario.vehicles]:
        times = np.array(after.fusion.times, dtype=np.int64)
        rows = np.array(after.fusion.rows).reshape(-1, ROW)
        during = (times >= first) & (times <= last)
        times, rows = times[during], rows[during]
        true = np.column_stack([np.interp(times, samples.time, axis) for axis in samples.target.T])
        rows[:, :3] -= true
        yield rows[np.isfinite(rows).all(axis=1)]


def counts(flight: Outcome) -> Counts:
    """Return the numbers of detections of all companions together, over the whole flight."""
    return Counts(
        *(sum(numbers) for numbers in zip(*(after.fusion.counts for _, after in flight.tallies), strict=True))
    )


def bearings_quality(scenario: Scenario, samples: Samples) -> tuple[Array, Array]:
    """Return |s|/Σw (T,), and tr Σ·a/2 (T,) of the true bearings with the accuracies of the formation.

    The latter is the trace of the covariance relative to the least possible one with s = 0.
    """
    formation = scenario.companion.formation
    model = formation if isinstance(formation, Perception) else Perception(kind="perception")
    count = scenario.vehicles
    off = samples.position[:, :count] - samples.target[:, None]
    bearings, distances = np.arctan2(off[..., 1], off[..., 0]), np.linalg.norm(off, axis=-1)
    sigmas = [model.accuracy(system) for system in scenario.systems[:count]]
    weights = np.column_stack(
        [weight(along, across, distances[:, k]) for k, (along, across) in enumerate(sigmas)]
    )
    s = np.abs([anisotropy(row, w) for row, w in zip(bearings, weights, strict=True)])
    # a_k − w_k = 1/σ_r².
    a = (weights + np.array([along**-2.0 for along, _ in sigmas])).sum(axis=1)
    return s / np.abs(weights).sum(axis=1), a**2 / (a**2 - s**2)
