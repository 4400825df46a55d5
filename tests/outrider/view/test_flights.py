"""Flights with somebody who looks on: they are what they are without, until something is changed by hand."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from outrider.runs.ground_truth import Samples
from outrider.scene.datagram_channel import DatagramChannel
from outrider.scene.view_commands import ViewCommands, encoded
from outrider.simulation.flight import Flight
from outrider.swarm.lockstep_view import LockStepView, moment
from outrider.view.viewer_client import ViewerClient
from tests.companion.bench import field_of
from tests.outrider.shipped import FIREFLY, LOGS, scenario
from tests.outrider.view.flights import flown, line, logs, moments, small


class Sent(LockStepView):
    """Tells every sample, whatever the wall says, and does what ``act`` wants at each."""

    def __init__(self, ours: DatagramChannel) -> None:
        super().__init__(ours)
        self.count = 0

    def __call__(self, flight: Flight, now: int) -> None:
        self._next = 0.0
        self.count += 1
        super().__call__(flight, now)


class Kills(Sent):
    """Kills the view in the middle of the flight."""

    def __init__(self, viewer: ViewerClient, which: signal.Signals) -> None:
        super().__init__(viewer.line)
        self._viewer, self._which = viewer, which

    def __call__(self, flight: Flight, now: int) -> None:
        if self.count == 60:
            os.kill(self._viewer.process.pid, self._which)
            if self._which is signal.SIGKILL:
                self._viewer.process.wait(10.0)
        super().__call__(flight, now)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What the flight leaves without a view."""
    directory = tmp_path_factory.mktemp("alone")
    flown(small(), directory, None)
    return logs(directory)


def test_who_is_only_seen_flies_as_alone(alone: dict[str, bytes], tmp_path: Path) -> None:
    """Nobody empties the line either: it fills up, and what does not fit is dropped."""
    with line(room=16_000) as (ours, theirs):
        view = Sent(ours)
        flown(small(), tmp_path, view)
        assert logs(tmp_path) == alone
        assert ours.dropped > 0
        found = moments(theirs)
        assert 0 < len(found) == view.count - ours.dropped


@pytest.mark.slow
@pytest.mark.parametrize("which", [signal.SIGKILL, signal.SIGSTOP])
def test_a_view_may_be_killed_or_hang(which: signal.Signals, alone: dict[str, bytes], tmp_path: Path) -> None:
    viewer = ViewerClient(port=18080)
    try:
        view = Kills(viewer, which)
        flown(small(), tmp_path, view)
        assert view.count > 100
        assert logs(tmp_path) == alone
    finally:
        viewer.process.send_signal(signal.SIGCONT)
        viewer.close()


def test_a_moment_is_what_is_true() -> None:
    """Positions, and attitudes by their yaw and tilt, against the samples of the truth."""
    flight = Flight(small(), FIREFLY, 3, LOGS, stopwatch=lambda: 0)
    seen = []
    flight._onlooker = lambda flight, now: seen.append((now, moment(flight, now)))
    flight.run()
    samples: Samples = flight.truth.samples()
    assert len(seen) > 100
    for now, one in seen[::10]:
        row = int(np.searchsorted(samples.time, now, side="right")) - 1
        np.testing.assert_allclose(one.position, samples.position[row], atol=0.2)
        w, x, y, z = one.attitude.T.astype(float)
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        off = np.angle(np.exp(1j * (yaw - samples.yaw[row])))
        np.testing.assert_allclose(off, 0.0, atol=0.05)
        tilt = np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0))
        np.testing.assert_allclose(tilt, samples.tilt[row], atol=0.05)
        # Forward is where the nose is, and up is up.
        np.testing.assert_allclose(one.target, flight.target.position(now), atol=1e-5)
    last = seen[-1][1]
    assert all(state.mode.startswith("escort") for state in last.states)
    assert np.isfinite(last.plan).all()
    # A plan begins near its vehicle.
    assert np.linalg.norm(last.plan[:, 0, :3] - last.position, axis=1).max() < 0.5


class Changes(Sent):
    """Says once, in the middle, what is wished."""

    def __init__(self, ours: DatagramChannel, theirs: DatagramChannel, commands: ViewCommands) -> None:
        super().__init__(ours)
        self._theirs, self._commands = theirs, commands

    def __call__(self, flight: Flight, now: int) -> None:
        self._theirs.receive()
        if self.count == 40:
            self._theirs.send(encoded(self._commands))
        super().__call__(flight, now)


def test_methods_loss_and_target_can_be_changed(alone: dict[str, bytes], tmp_path: Path) -> None:
    place = (2.0, -1.0, 4.0)
    with line() as (ours, theirs):
        view = Changes(
            ours, theirs, ViewCommands(methods="swivel+tangential", loss=0.5, target=place, moves=1)
        )
        flight = flown(small(), tmp_path, view)
    assert logs(tmp_path) != alone
    ((at, change),) = view.orders.given
    assert change.methods == "swivel+tangential"
    assert at is not None
    assert all(len(field_of(companion).planner._methods) == 2 for companion in flight.companions)
    counters = flight.network.counters
    assert counters.dropped > 0.05 * counters.sent
    target = flight.truth.samples().target
    np.testing.assert_allclose(target[-1], place)
    # The companions saw it move: by MAVLink, as everything.
    seen = flight.companions[0].world.target._track.last[:3]
    assert np.linalg.norm(np.subtract(seen, place)) < 2.0


@pytest.mark.parametrize("name", ["escort", "walk"])
def test_a_target_on_its_way_goes_on_from_where_it_is_put(name: str) -> None:
    flight = Flight(scenario(name), FIREFLY, 1, LOGS)
    target, other = flight.target, flight.fleet.target()
    for one in (target, other):
        one.begin(0)
        one.position(2_000_000)
    here, aside = other.position(2_000_000), np.array([3.0, -2.0, 1.0])
    assert here is not None
    target.move(2_000_000, here + aside)
    for now in (2_000_000, 4_000_000, 6_000_000):
        moved, there = target.position(now), other.position(now)
        assert moved is not None
        assert there is not None
        np.testing.assert_allclose(moved - there, aside, atol=1e-9)
        told, plain = target.step(now, []), other.step(now, [])
        assert [len(one.data) > 0 for one in told] == [len(one.data) > 0 for one in plain]
        assert told
        assert told != plain
