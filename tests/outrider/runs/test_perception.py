"""Figures of fused detections: errors by the truth at their time, counters, quality of the bearings."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from companion.estimation.fusion_log import Counts, FusionTally
from companion.planning.avoidance import Tally
from outrider.runs.outcome import Outcome
from outrider.runs.perception import bearings_quality, counts, estimates
from tests.outrider.runs.test_summary import hovering
from tests.outrider.shipped import scenario


def tally(times, rows, **numbers: int) -> tuple[Tally, Tally]:
    fusion = FusionTally(Counts(**numbers), times, np.ravel(rows).tolist())
    return Tally(0, 0, 0, 0, 0, ()), Tally(0, 0, 0, 0, 0, (), fusion=fusion)


def flown(*tallies: Any) -> Outcome:
    return cast("Outcome", SimpleNamespace(scenario=scenario("perception"), tallies=tallies))


def test_errors_are_against_the_truth_at_the_time_of_the_estimate() -> None:
    samples = hovering(51)
    target = np.column_stack([np.linspace(0.0, 1.0, 51), np.zeros(51), np.zeros(51)])
    samples = samples._replace(target=target)
    row = [0.5 + 0.2, 0.0, 0.0, *np.diag([0.04, 1.0, 1.0]).ravel(), 4.0]
    found = estimates(flown(tally([-10, 500_000, 2_000_000], [row] * 3)), samples)
    np.testing.assert_allclose(found.errors, [[0.2, 0.0, 0.0]])
    np.testing.assert_allclose(found.nees, [1.0])
    np.testing.assert_array_equal(found.seen_by, [4.0])


def test_counters_are_those_of_all_companions() -> None:
    found = counts(flown(tally([], [], sent=2, used=5), tally([], [], sent=1, late=3)))
    assert found == Counts(sent=3, used=5, late=3)


def test_an_even_ring_is_the_best_and_one_line_the_worst() -> None:
    of = scenario("perception")
    angles = 2.0 * np.pi * np.arange(5) / 5
    ring = np.column_stack([6.0 * np.cos(angles), 6.0 * np.sin(angles), np.full(5, 5.0)])
    line = np.tile([6.0, 0.0, 5.0], (5, 1))
    samples = hovering(2, 5)._replace(position=np.array([ring, line]))
    shares, ratios = bearings_quality(of, samples)
    np.testing.assert_allclose(shares, [0.0, 1.0], atol=1e-9)
    assert ratios[0] == pytest.approx(1.0)
    assert ratios[1] > 5.0
