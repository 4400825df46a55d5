"""Five companions on five vehicles, through all that may happen: nobody comes too near, all is reported, all
land; and in a sortie, whose figures all pass their bars. These tests really wait; they assert no timing,
but want a machine of their own: five companions that have to wait for a core for a second of a flight see
nothing for so long."""

from __future__ import annotations

from pathlib import Path

import pytest

from trials.__main__ import trial
from trials.plan import FLAVOURS, SORTIE, Plan


@pytest.mark.soak
@pytest.mark.parametrize("speed", [1.0, 5.0, 10.0])
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_trial(tmp_path: Path, flavour: str, speed: float) -> None:
    assert trial(Plan(flavour, speed), tmp_path)["faults"] == []


@pytest.mark.soak
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_sortie(tmp_path: Path, flavour: str) -> None:
    assert trial(Plan(flavour, 1.0, SORTIE), tmp_path)["faults"] == []
