"""Flights under the wall clock, one process per node over UDP: these tests really wait. They assert no
timing, as a busy machine is late."""

from __future__ import annotations

import os
import pickle
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CameraTrackingGeo, GlobalPosition, Tunnel
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.realtime.flight import RealTimeFlight
from outrider.realtime.view import RealTimeView
from outrider.resources import config_root
from outrider.runs.summary import Cost, exit_status, summarise
from outrider.scene.changes import Change
from outrider.scene.datagram_channel import DatagramChannel, pair
from outrider.scene.snapshot import Snapshot
from outrider.scene.view_commands import ViewCommands, encoded
from outrider.simulation.conductor import Stage
from tests.scenarios.lockstep_flights import FIREFLY, scenario, setpoints

LOGS = config_root() / "logs"
SMALL: dict[str, Any] = {
    "vehicles": 2,
    "airborne": True,
    "cap_s": 4.0,
    "starts": {
        "kind": "points",
        "at": [[-2.0, 0.0, 5.0], [2.0, 0.0, 5.0]],
        "goals": [[-2.0, 3.0, 5.0], [2.0, 3.0, 5.0]],
    },
    "task": "goto",
}
HANGS = {"faults": [{"kind": "freeze", "vehicle": 12, "at_s": 0.5, "for_s": 1.0}]}
CUT = {"partitions": [{"at_s": 0.2, "for_s": 1.0, "members": [11]}]}
COMES: dict[str, Any] = {
    "kind": "post",
    "radius": 0.5,
    "speed": 1.5,
    "shares_plan": True,
    "through": [[6.0, 4.0], [9.0, 1.0], [9.0, -5.0], [6.0, -2.0]],
}


SEES = {
    "mount": {"kind": "gimbal", "pitch_deg": 60.0},
    "pixel_sigma": 0.0,
    "object": {"height": 0.3, "height_sigma": 0.0},
}


def detected(log: Path, by: int, frame: FleetFrame) -> np.ndarray:
    """The places (n, 3) that the camera of system ``by`` detected."""
    codec = Codec(lambda _identifier, *source: source == (by, 100))
    found = [message for record in read_tlog(log) for message in codec.feed(record.frame)]
    return np.array(
        [
            frame.to_enu(one.latitude, one.longitude, one.altitude)
            for one in found
            if isinstance(one, CameraTrackingGeo)
        ]
    )


def said(log: Path, by: int) -> set[type]:
    """The messages of system ``by`` in a log."""
    codec = Codec(lambda _identifier, system, _component: system == by)
    return {type(message) for record in read_tlog(log) for message in codec.feed(record.frame)}


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [{}, {**HANGS, **CUT, "moving": [COMES], "camera": SEES}],
    ids=["calm", "frozen, cut off, and a post"],
)
def test_a_flight_in_real_time(changes: dict[str, Any], tmp_path: Path) -> None:
    of = scenario("antipodal-8", SMALL, changes)
    flight = RealTimeFlight(of, FIREFLY, 1, LOGS, tmp_path)
    flight.run()
    outcome = flight.outcome
    assert outcome.failure is None
    assert outcome.clock_start is not None
    samples = outcome.truth.samples(outcome.clock_start, outcome.clock_end)
    assert np.isfinite(samples.position).all()
    assert (np.diff(samples.time) == 20_000).all()
    assert outcome.truth.vehicles.minimum > 2.0
    # A post that moves is where it should be, and was heard of.
    assert samples.moving.shape == (len(samples.time), len(of.moving), 3)
    assert (outcome.truth.obstacles.minimum < 10.0) == bool(of.moving)
    if of.moving:
        assert np.linalg.norm(samples.moving[-1, 0] - (6.0, 4.0, 0.0)) > 2.0
        assert all(said(log, 190) == {GlobalPosition, Tunnel} for log in tmp_path.glob("*.tlog"))
    # On their way, or there: nobody was left hanging.
    assert (samples.position[-1, :, 1] > 1.0).all()
    summary = summarise(outcome, Cost(1.0, 1.0), tmp_path)
    assert summary["d_min_violations"] == 0
    assert summary["messages"]["bad"] == 0  # type: ignore[index,call-overload]
    late = outcome.punctuality
    assert late is not None
    assert summary["deadline_misses"] == late.misses <= late.deadlines == summary["deadline_steps"]
    assert late.deadlines > 200
    assert outcome.messages.dropped > 0 or "partitions" not in changes
    for system in outcome.systems:
        log = tmp_path / f"vehicle-{system}.tlog"
        assert read_tlog(log).report.skipped_bytes == 0
        assert len(setpoints(log)) > 20
        if of.camera is not None:
            # The target stands; what hides it at times does not move it.
            places = detected(log, system, flight.fleet.frame)
            assert len(places) > 5
            assert np.abs(places - flight.fleet.target().position(0)).max() < 0.05


@pytest.mark.slow
def test_an_interrupt_lands_and_leaves_whole_logs(tmp_path: Path) -> None:
    of = scenario(
        "antipodal-8",
        SMALL,
        {"cap_s": 600.0, "starts": {"kind": "points", "goals": [[-2.0, 9.0, 5.0], [2.0, 9.0, 5.0]]}},
    )
    sent = threading.Event()

    def watch(stage: Stage, seconds: float) -> None:
        if stage is Stage.CLOCK and seconds > 1.0 and not sent.is_set():
            sent.set()
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    flight = RealTimeFlight(of, FIREFLY, 1, LOGS, tmp_path, watch)
    flight.run()
    assert sent.is_set()
    assert signal.getsignal(signal.SIGINT) is before
    outcome = flight.outcome
    assert outcome.failure == "interrupted: all vehicles were told to land"
    heights = outcome.truth.samples().position[-1, :, 2]
    assert np.abs(heights).max() < 0.2
    assert exit_status(summarise(outcome, Cost(1.0, 1.0), tmp_path)) == 1
    for system in outcome.systems:
        assert read_tlog(tmp_path / f"vehicle-{system}.tlog").report.skipped_bytes == 0


@pytest.mark.slow
def test_a_flight_in_real_time_with_a_view(tmp_path: Path) -> None:
    """Somebody looks on, changes methods, loss and target in mid-flight, and is gone before the end."""
    ours, theirs = (DatagramChannel(end) for end in pair())
    place = (1.0, 2.0, 4.0)
    seen: list[Snapshot] = []

    class Watched(RealTimeView):
        def changes(self, seconds: float | None) -> Iterator[Change]:
            seen.extend(pickle.loads(data) for data in theirs.receive())
            if seconds is not None and seconds > 0.5:
                theirs.send(encoded(ViewCommands(methods="swivel", loss=0.5, target=place, moves=1)))
            if seconds is not None and seconds > 1.5:
                theirs.close()
            return super().changes(seconds)

    view = Watched(ours)
    flight = RealTimeFlight(scenario("antipodal-8", SMALL), FIREFLY, 1, LOGS, tmp_path, view=view)
    flight.run()
    outcome = flight.outcome
    assert outcome.failure is None
    # Not one for each sample; and every vehicle was there, with its plan and attitude.
    assert len(seen) > 5
    last = seen[-1]
    assert np.isfinite(last.position).all()
    assert np.isfinite(last.plan).all()
    np.testing.assert_allclose(np.linalg.norm(last.attitude, axis=1), 1.0, atol=1e-5)
    assert all(state.mode.startswith("escort") for state in last.states)
    (_, change), *more = view.orders.given
    assert not more
    assert change == Change("swivel", 0.5, place)
    np.testing.assert_allclose(outcome.truth.samples().target[-1], place)
    assert outcome.messages.dropped > 0
    ours.close()
