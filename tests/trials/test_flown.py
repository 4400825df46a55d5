"""What a companion's log tells of its flight, on the trial's time and in the fleet frame."""

from __future__ import annotations

import numpy as np
import pytest

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import (
    GlobalPosition,
    GpsGlobalOrigin,
    LocalPosition,
    SetpointLocal,
    Source,
)
from mavlink_bridge.tlog.log import TlogWriter
from mavlink_bridge.wire.codec import Codec
from trials.flown import flown, flown_by_clock
from trials.plan import TARGET

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
OWN, AUTOPILOT, OTHER = Source(3, 195), Source(3, 1), Source(4, 1)
START = 1_700_000_000_000_000
"""µs: the companion's clock when the target's shows 5 s since its boot, and the trial's 105 s."""
RATE = 0.99
"""Of the companion's clock against the target's."""
ROUNDED = 0.006
"""m: an origin is told in steps of 1e-7 degrees."""


def place(t):
    """Fleet-local, of the set-points."""
    return np.array([2.0 + 1.5 * t, -1.0 + 0.5 * t, 5.0])


def written(path, steering=True):
    """Four seconds; the vehicle is 0.2 m north of its set-points, and its own origin 10 m east."""
    local = FLEET.local(*FLEET.to_geodetic((10.0, 0.0, 0.0)))
    codec = Codec()

    def ned(enu):
        return tuple(local.position_to_local(enu).tolist())

    velocity = tuple(local.velocity_to_local(np.array([1.5, 0.5, 0.0])).tolist())
    zero = (0.0, 0.0, 0.0)
    with TlogWriter(path) as log:

        def note(t, link, message):
            log.write(START + round(1e6 * RATE * t), link, codec.encode(message))

        note(0.0, 0, GpsGlobalOrigin(AUTOPILOT, *FLEET.to_geodetic((10.0, 0.0, 0.0)), 0))
        for k in range(201):
            t = 0.02 * k
            if k % 10 == 0:
                since = 5_000_000 + round(1e6 * t)
                where = (*FLEET.to_geodetic((0.0, 8.0, 1.5)), 0.0, zero, None)
                note(t, 2, GlobalPosition(Source(TARGET, 1), since, *where))
            there = place(t) + np.array([0.0, 0.2, 0.0])
            note(t, 0, LocalPosition(AUTOPILOT, 7_000, ned(there), velocity))
            note(t, 1, LocalPosition(OTHER, 7_000, zero, zero))
            if steering:
                sent = SetpointLocal(OWN, 0, 3, 1, 1, 0, ned(place(t)), velocity, zero, 0.0, 0.0)
                note(t, 0, sent)
    return path


def seconds(since_boot):
    return 100.0 + 1e-6 * since_boot


def test_a_log_is_read_onto_the_trials_time(tmp_path) -> None:
    found = flown(written(tmp_path / "vehicle-3.tlog"), 3, FLEET, seconds)
    assert found is not None
    setpoints, reported = found
    times = setpoints.times
    assert (times[0], times[-1]) == (pytest.approx(105.0, abs=0.001), pytest.approx(109.0, abs=0.001))
    wanted = np.array([place(t - 105.0) for t in times])
    assert np.abs(setpoints.places - wanted).max() < ROUNDED
    assert np.diff(setpoints.clock) == pytest.approx(0.02 * RATE, abs=1e-5)
    assert setpoints.velocities[0] == pytest.approx([1.5, 0.5, 0.0], abs=1e-4)
    off = reported.at(times) - setpoints.places
    assert np.nanmax(np.abs(off - [0.0, 0.2, 0.0])) < 0.002


def test_who_never_steered_has_not_flown(tmp_path) -> None:
    assert flown(written(tmp_path / "vehicle-3.tlog", steering=False), 3, FLEET, seconds) is None
    assert flown(tmp_path / "vehicle-3.tlog", 9, FLEET, seconds) is None


def test_a_log_without_a_target_is_read_onto_the_trials_time_by_the_companions_clock(tmp_path) -> None:
    def trial(clock):
        return 105.0 + (clock - 1e-6 * START) / RATE

    found = flown_by_clock(written(tmp_path / "vehicle-3.tlog"), 3, FLEET, trial)
    assert found is not None
    times = found.setpoints.times
    assert (times[0], times[-1]) == (pytest.approx(105.0, abs=0.001), pytest.approx(109.0, abs=0.001))
    wanted = np.array([place(t - 105.0) for t in times])
    assert np.abs(found.setpoints.places - wanted).max() < ROUNDED
    assert flown_by_clock(tmp_path / "vehicle-3.tlog", 9, FLEET, trial) is None
