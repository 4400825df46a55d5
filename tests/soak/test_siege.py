"""Ten minutes of fuzz on both links of companions in flight, unsigned and signed."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.soak.siege import BOUT, PEACE, Siege
from tests.soak.test_mishaps import shown

TEN = 600.0
Progress = Callable[[float], None]


def signed(seed: int, seconds: float, count: int, progress: Progress = lambda _s: None) -> None:
    """With a stranger it is the flight without one, to the last bit."""
    quiet = Siege(seed, seconds, signed=True, besieged=False, count=count, progress=progress)
    quiet.fly()
    loud = Siege(seed, seconds, signed=True, besieged=True, count=count, progress=progress)
    loud.fly()
    assert loud.trails == quiet.trails
    assert loud.setpoints == quiet.setpoints
    assert sum(loud.stranger.said.values()) > seconds
    assert loud.refused > quiet.refused
    assert not sum(quiet.stranger.said.values())


def unsigned(seed: int, seconds: float, count: int, progress: Progress = lambda _s: None) -> None:
    """Within the limits all the while, and in its place again when it is over and everything began anew."""
    flown = Siege(seed, seconds, signed=False, besieged=True, count=count, progress=progress)
    flown.fly()
    assert flown.setpoints > seconds
    assert flown.peaces == round(seconds // (BOUT + PEACE)) + (seconds % (BOUT + PEACE) > PEACE)


@pytest.mark.slow
def test_a_stranger_on_signed_links_is_as_nobody() -> None:
    signed(2, PEACE + 8.0, 1)


@pytest.mark.slow
def test_a_stranger_on_unsigned_links_leads_nobody_beyond_the_limits() -> None:
    unsigned(2, PEACE + 15.0, 1)


@pytest.mark.soak
def test_ten_minutes_of_strangers_on_signed_links(capfd: pytest.CaptureFixture[str]) -> None:
    signed(1, TEN, 3, shown(TEN, capfd))


@pytest.mark.soak
def test_ten_minutes_of_strangers_on_unsigned_links(capfd: pytest.CaptureFixture[str]) -> None:
    unsigned(1, TEN, 3, shown(TEN, capfd))
