"""Tracking errors of a certified trial: reported and true ones differ by the error of the estimate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import GpsGlobalOrigin, Heartbeat, LocalPosition, SetpointLocal, Source
from mavlink_bridge.tlog.log import TlogWriter
from mavlink_bridge.wire.codec import Codec
from trials.certified_tracking import certified_tracking, logs_of
from trials.separation import Track

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
ORIGIN = (47.397742, 8.545594, 488.0)
OWN, AUTOPILOT = Source(3, 195), Source(3, 1)
START = 1_700_000_000
AHEAD, FAST = 2.5, 1.01
"""s and ratio: the companion's clock against the trial's."""
SECONDS = 20.0
ALWAYS = (0.0, SECONDS)


def clock(t: float) -> float:
    """Reading of the companion's clock at ``t`` s of the trial."""
    return START + AHEAD + FAST * t


def seconds(shown):
    return (shown - START - AHEAD) / FAST


def place(t):
    """Fleet-local, of the set-points."""
    return np.array([1.0 * t, 2.0, 5.0])


def written(path: Path, off, *, hung: bool = False) -> Path:
    """Set-points and reported positions, which are ``off`` (m, ENU) from them.

    A companion that ``hung`` for 3 s reads the positions of that time together.
    """
    local = FLEET.local(*ORIGIN)
    codec = Codec()
    path.parent.mkdir(parents=True, exist_ok=True)
    velocity = tuple((local.velocity_to_local(np.array([1.0, 0.0, 0.0])) / FAST).tolist())
    with TlogWriter(path) as log:

        def note(t, message):
            log.write(round(1e6 * clock(t)), 0, codec.encode(message))

        note(0.0, Heartbeat(AUTOPILOT, 2, 3, 0x81, 4, 4))
        note(0.0, GpsGlobalOrigin(AUTOPILOT, *ORIGIN, 0))
        for k in range(round(25 * SECONDS)):
            t = 0.04 * k
            if hung and 8.0 <= t < 11.0:
                continue
            goal = tuple(local.position_to_local(place(t)).tolist())
            here = tuple(local.position_to_local(place(t) + np.array(off)).tolist())
            note(t, SetpointLocal(OWN, 0, 3, 1, 1, 0, goal, velocity, (0.0, 0.0, 0.0), 0.0, 0.0))
            note(t, LocalPosition(AUTOPILOT, round(1e6 * t), here, velocity))
            if hung and t == 11.0:
                for late in np.arange(8.0, 11.0, 0.04):
                    there = tuple(local.position_to_local(place(late) + np.array(off)).tolist())
                    note(t, LocalPosition(AUTOPILOT, round(1e6 * late), there, velocity))
    return path


def test_positions_that_were_read_late_say_nothing_of_the_estimate(tmp_path) -> None:
    log = written(tmp_path / "vehicle-3.tlog", (0.0, 0.0, 0.2), hung=True)
    found = certified_tracking([log], 3, FLEET, truth((0.0, 0.0, 0.0)), seconds, ALWAYS)
    assert found.estimate == pytest.approx(0.2, abs=0.12)


def truth(off) -> Track:
    """True positions, ``off`` (m, ENU) from the set-points, at times of their own."""
    times = np.arange(0.007, SECONDS, 0.02)
    places = np.array([place(t) + np.array(off) for t in times])
    return Track(times, places, np.ones(len(times), dtype=bool))


def test_reported_true_and_estimated_distances_are_those_of_the_flight(tmp_path) -> None:
    log = written(tmp_path / "vehicle-3.tlog", (0.0, 0.6, 0.0))
    found = certified_tracking([log], 3, FLEET, truth((0.0, 0.6, 0.8)), seconds, ALWAYS)
    assert found.reported == pytest.approx(0.6, abs=0.01)
    assert found.estimate == pytest.approx(0.8, abs=0.01)
    assert found.true == pytest.approx(1.0, abs=0.01)


def test_true_positions_count_while_the_companion_steered(tmp_path) -> None:
    log = written(tmp_path / "vehicle-3.tlog", (0.0, 0.0, 0.0))
    off = truth((0.0, 0.0, 0.0))
    astray = off._replace(places=off.places + (off.times[:, None] > 10.0) * np.array([0.0, 0.0, 9.0]))
    found = certified_tracking([log], 3, FLEET, astray, seconds, (1.0, 9.0))
    assert found.true == pytest.approx(0.0, abs=0.02)
    assert found.estimate == pytest.approx(0.0, abs=0.02)
    assert certified_tracking([log], 3, FLEET, astray, seconds, ALWAYS).true == pytest.approx(9.0, abs=0.02)


def test_what_is_not_known_is_none(tmp_path) -> None:
    log = written(tmp_path / "vehicle-3.tlog", (0.0, 0.6, 0.0))
    assert certified_tracking([log], 3, FLEET, None, seconds, ALWAYS).document == {
        "reported": pytest.approx(0.6, abs=0.01),
        "estimate": None,
        "true": None,
    }
    assert certified_tracking([], 3, FLEET, truth((0.0, 0.0, 0.0)), seconds, ALWAYS).document == {
        "reported": None,
        "estimate": None,
        "true": None,
    }


def test_logs_of_all_lives_count_and_those_of_backup_nodes_do_not(tmp_path) -> None:
    flown = ["life-1/vehicle-3.tlog", "life-1/restart-1/vehicle-3.tlog"]
    for name in [*flown, "life-1/backup-1/vehicle-3.tlog", "life-1/vehicle-4.tlog"]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert logs_of(tmp_path, 3) == sorted(tmp_path / name for name in flown)
