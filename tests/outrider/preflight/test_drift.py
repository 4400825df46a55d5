"""The drift is the largest horizontal distance from where a take-off or a landing began, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.values.phase import Phase
from outrider.preflight.drift import DriftMeter

_places = st.lists(st.tuples(*[st.floats(-5.0, 5.0)] * 3), min_size=1, max_size=5)
BY_THE_AUTOPILOT = (Phase.PREPARE, Phase.LAND)


@given(st.lists(st.tuples(st.sampled_from(Phase), _places), max_size=6))
def test_only_take_off_and_landing_count_each_from_its_own_beginning(
    flight: list[tuple[Phase, list[tuple[float, float, float]]]],
) -> None:
    meter = DriftMeter()
    largest = None
    before, begin = None, np.zeros(2)
    for phase, places in flight:
        for place in places:
            here = np.array(place)
            meter.see(phase, here)
            if phase is not before:
                before, begin = phase, here[:2]
            if phase in BY_THE_AUTOPILOT:
                largest = max(largest or 0.0, float(np.hypot(*(here[:2] - begin))))
    # The two roots may differ in the last bit.
    assert meter.largest == (None if largest is None else pytest.approx(largest, rel=1e-12))
