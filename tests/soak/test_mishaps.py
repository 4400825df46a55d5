"""An hour in lock-step through mishaps: every one answered as docs/guard.md says, and nothing grows."""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable

import pytest

from tests.soak.mishaps import MISHAPS
from tests.soak.sorties import LEG, REST, Sorties

FLAT = 2 << 20
"""Bytes either way. Of the process, not of Python's objects: the solver and the compiled kernels have memory
too."""
WARM = 900.0
"""s in which caches fill: of compiled code, of plans read, of terms of the filters."""
HOUR = 3600.0


def shown(whole: float, capfd: pytest.CaptureFixture[str]) -> Callable[[float], None]:
    """How far it is, on a terminal."""

    def progress(seconds: float) -> None:
        with capfd.disabled():
            if sys.stderr.isatty():
                sys.stderr.write(f"\r{seconds:.0f} of {whole:.0f} s ")
                sys.stderr.flush()

    return progress


@pytest.mark.slow
def test_some_mishaps_the_same_twice() -> None:
    flown = [Sorties(3, 45.0, count=2, first=10.0) for _ in range(2)]
    for each in flown:
        each.fly()
        assert sum(each.begun.values()) > 2
        assert sum(each.judged.values()) > 1
    assert flown[0].fingerprint() == flown[1].fingerprint()


@pytest.mark.soak
@pytest.mark.parametrize("seed", [1])
def test_an_hour_of_mishaps(seed: int, capfd: pytest.CaptureFixture[str]) -> None:
    flown = Sorties(seed, HOUR, progress=shown(HOUR, capfd))
    flown.fly()
    assert flown.rests == int(HOUR // (LEG + REST))
    assert flown.begun.keys() == {mishap.name for mishap in MISHAPS}
    assert flown.judged.keys() >= {f"noticed: {mishap.name}" for mishap in MISHAPS if mishap.sentence}
    assert flown.sorties > 60
    warm = [size for seconds, size in flown.memory if seconds >= WARM]
    middle = statistics.median(warm)
    assert max(abs(size - middle) for size in warm) <= FLAT, flown.memory
