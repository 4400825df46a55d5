"""Ten minutes of ``outrider fly`` on vehicles of ``outrider sitl`` under the wall clock, in trouble all the
time. It really waits; it asserts no timing."""

from __future__ import annotations

import statistics
from pathlib import Path

import pytest

from tests.soak.flock import Flock, check_summaries
from tests.soak.test_mishaps import FLAT, shown

TEN = 600.0
WARM = 240.0
"""s of a process in which its caches fill: thousands of gains of its filters, and of frames."""


@pytest.mark.slow
def test_some_seconds_in_real_time(tmp_path: Path) -> None:
    flock = Flock(tmp_path, ("px4",), 1, 6.0)
    flock.fly()
    check_summaries(flock.birds)
    assert sum(flock.troubles[0].begun.values()) >= 1


@pytest.mark.soak
def test_ten_minutes_in_real_time(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    flock = Flock(tmp_path, ("ardupilot", "px4"), 1, TEN, shown(TEN, capfd))
    flock.fly()
    check_summaries(flock.birds)
    for trouble in flock.troubles:
        assert len(trouble.begun) >= 5, trouble.begun
    looked_at = 0
    for bird in flock.birds:
        for readings in bird.memory.values():
            warm = [size for seconds, size in readings if seconds - readings[0][0] >= WARM]
            if len(warm) > 5:
                looked_at += 1
                middle = statistics.median(warm)
                assert max(abs(size - middle) for size in warm) <= FLAT, readings
    assert looked_at >= 2
