"""A simulation that stood still is told from one whose messages were read late."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mavlink_bridge.messages import LocalPosition, Source
from mavlink_bridge.tlog.log import TlogWriter
from mavlink_bridge.wire.codec import Codec
from trials.pace import pace_of

AUTOPILOT = Source(3, 1)
START = 1_700_000_000
NOWHERE = (0.0, 0.0, 0.0)


def written(path: Path, arrivals, stamps) -> list[Path]:
    """A log of positions with the vehicle's ``stamps`` (s), which arrived at ``arrivals`` (s)."""
    codec = Codec()
    with TlogWriter(path) as log:
        for at, stamp in zip(arrivals, stamps, strict=True):
            message = LocalPosition(AUTOPILOT, round(1e6 * stamp), NOWHERE, NOWHERE)
            log.write(round(1e6 * (START + at)), 0, codec.encode(message))
    return [path]


STAMPS = np.arange(5.0, 45.0, 0.02)


@pytest.mark.parametrize("factor", [1.0, 0.98, 0.9])
def test_the_pace_of_a_slow_simulation_is_told(factor: float, tmp_path: Path) -> None:
    found = pace_of(written(tmp_path / "a.tlog", STAMPS / factor + 0.01, STAMPS), 3)
    assert found is not None
    assert found.factor == pytest.approx(factor, abs=0.005)


@pytest.mark.parametrize("stood", [0.1, 0.5])
def test_a_simulation_that_stood_still_has_lost_that_time(stood: float, tmp_path: Path) -> None:
    arrivals = STAMPS + np.where(STAMPS > 20.3, stood, 0.0)
    found = pace_of(written(tmp_path / "a.tlog", arrivals, STAMPS), 3)
    assert found is not None
    assert found.lost == pytest.approx(stood, abs=0.01)
    assert found.factor == pytest.approx(1.0 - stood / 40.0, abs=0.002)


def test_late_readers_lose_no_time(tmp_path: Path) -> None:
    """Most messages are up to 80 ms late, and a companion that hung read those of 3 s together."""
    late = np.random.default_rng(1).uniform(0.0, 0.08, len(STAMPS))
    arrivals = STAMPS + late
    hung = (STAMPS > 20.0) & (STAMPS < 23.0)
    arrivals[hung] = 23.0
    found = pace_of(written(tmp_path / "a.tlog", np.maximum.accumulate(arrivals), STAMPS), 3)
    assert found is not None
    assert found.lost < 0.03
    assert found.factor == pytest.approx(1.0, abs=0.002)


def test_short_logs_and_other_vehicles_say_nothing(tmp_path: Path) -> None:
    few = STAMPS[:400]
    short = written(tmp_path / "a.tlog", few, few)
    assert pace_of(short, 3) is None
    assert pace_of(written(tmp_path / "b.tlog", STAMPS, STAMPS), 4) is None
    assert pace_of([], 3) is None


def test_of_several_logs_the_slowest_counts(tmp_path: Path) -> None:
    good = written(tmp_path / "a.tlog", STAMPS, STAMPS)
    bad = written(tmp_path / "b.tlog", STAMPS / 0.9, STAMPS)
    found = pace_of(good + bad, 3)
    assert found is not None
    assert found == pace_of(bad, 3)
    assert set(found.document) == {"factor", "lost_s"}
