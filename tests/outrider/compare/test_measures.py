"""Figures of a comparison: distances in the scene's measure, also between samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.compare.comparison import Measure
from outrider.compare.measures import between, scaled

BALL = Measure(kind="ball", least=0.3)
BOX = Measure(kind="box", least=0.24)
ELLIPSOID = Measure(kind="ellipsoid", least=0.3, downwash=2.0)
Coordinate = st.floats(-100.0, 100.0)


@given(st.tuples(Coordinate, Coordinate, Coordinate))
def test_the_measures_are_ordered(offset: tuple[float, float, float]) -> None:
    box, ball, ellipsoid = (float(scaled(np.array(offset), one)) for one in (BOX, BALL, ELLIPSOID))
    assert box <= ball + 1e-9
    assert 0.5 * ball <= ellipsoid + 1e-9
    assert ellipsoid <= ball + 1e-9
    assert ball <= np.sqrt(3.0) * box + 1e-9


def test_an_ellipsoid_is_as_high_as_its_downwash() -> None:
    assert scaled(np.array((0.0, 0.0, 0.6)), ELLIPSOID) == pytest.approx(0.3)
    assert scaled(np.array((0.3, 0.0, 0.0)), ELLIPSOID) == pytest.approx(0.3)


@given(st.integers(0, 2**32 - 1))
def test_cubic_motion_is_exact_between_samples(seed: int) -> None:
    c = np.random.default_rng(seed).uniform(-5.0, 5.0, size=(4, 2, 3))
    step = 0.02

    def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        t = t[:, None, None]
        return c[0] + t * (c[1] + t * (c[2] + t * c[3])), c[1] + t * (2.0 * c[2] + 3.0 * t * c[3])

    fine = between(*motion(step * np.arange(6)), step)
    assert np.allclose(fine, motion(step / 8.0 * np.arange(41))[0], atol=1e-9)
