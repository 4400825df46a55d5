"""A companion in the air, for the tests of the companion."""

from __future__ import annotations

import pytest

from tests.companion.bench import FLAVOURS, Bench


@pytest.fixture(params=FLAVOURS)
def flying(request):
    """In the air at 5 m, under control, for either autopilot."""
    bench = Bench(request.param).take_off(5.0)
    bench.fly(0.5)
    return bench
