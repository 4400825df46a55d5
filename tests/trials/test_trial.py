"""Five companions on five vehicles, through all that may happen: nobody comes too near, all is reported, all
land. These tests really wait; they assert no timing."""

from __future__ import annotations

from pathlib import Path

import pytest

from trials.__main__ import trial
from trials.plan import FLAVOURS, Plan


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_trial_five_times_as_fast(tmp_path: Path, flavour: str) -> None:
    assert trial(Plan(flavour, 5.0), tmp_path)["faults"] == []


@pytest.mark.soak
@pytest.mark.parametrize("speed", [1.0, 10.0])
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_trial_at_another_speed(tmp_path: Path, flavour: str, speed: float) -> None:
    assert trial(Plan(flavour, speed), tmp_path)["faults"] == []
