"""The checker's own distances are those that companions keep."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified import margins
from companion.config import CompanionConfig
from outrider.certify.distances import for_column, of_plans, of_surfaces

lengths = st.floats(0.01, 3.0)
axes = st.tuples(*[st.floats(0.2, 9.0)] * 3)


@given(
    tube=lengths,
    drift=lengths,
    sigma=st.floats(0.0, 2.0),
    sigmas=st.floats(0.0, 4.0),
    clock=st.integers(0, 90_000),
    fastest=axes,
    back=st.none() | axes,
    least=st.none() | st.floats(0.1, 2.0),
    d_min=st.floats(0.1, 1.0),
)
def test_both_promise_the_same(
    tube: float,
    drift: float,
    sigma: float,
    sigmas: float,
    clock: int,
    fastest: tuple[float, float, float],
    back: tuple[float, float, float] | None,
    least: float | None,
    d_min: float,
) -> None:
    certified = {"tube": tube, "drift": drift, "sigmas": sigmas, "clock_us": clock, "d_min_obstacle": least}
    limits = {"v_max": fastest, "v_min": None if back is None else tuple(-v for v in back)}
    document = {"certified": certified, "limits": limits, "field": {"position_sigma": sigma, "d_min": d_min}}
    config = CompanionConfig.model_validate(document)
    parts = config.certified, config.field, config.limits
    assert of_plans(config) == pytest.approx(margins.between(*parts), rel=1e-12)
    assert of_surfaces(config) == pytest.approx(margins.from_surfaces(*parts), rel=1e-12)
    assert for_column(config) == pytest.approx(margins.further(config.certified), abs=1e-12)
