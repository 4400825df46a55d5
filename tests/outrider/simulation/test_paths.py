"""Closed paths: through their places, closed, at constant speed, and what walks on them says so truly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_bridge.frames import FleetFrame, ned_to_enu
from mavlink_bridge.messages import GlobalPosition
from mavlink_bridge.wire.codec import Codec
from outrider.scenarios.options import Options
from outrider.scenarios.scenario import PathTarget
from outrider.simulation.paths import ClosedPath
from outrider.simulation.preparation import prepare
from outrider.simulation.targets import Walking
from tests.outrider.ways import bent_ring

FLEET = FleetFrame(47.4, 8.5, 488.0)
LAWS = settings(deadline=None, max_examples=40)
PLACES = st.integers(3, 9).flatmap(lambda n: st.integers(0, 2**32 - 1).map(lambda seed: bent_ring(n, seed)))


@LAWS
@given(PLACES)
def test_it_leads_through_every_place_and_is_closed(places: np.ndarray) -> None:
    path = ClosedPath(places)
    ways = np.linspace(0.0, path.length, 601)
    points = np.array([path.at(s, 1.0).position for s in ways])
    for place in places:
        nearest = ways[np.linalg.norm(points - place, axis=1).argmin()]
        near = np.linspace(nearest - ways[1], nearest + ways[1], 21) % path.length
        assert min(np.linalg.norm(path.at(s, 1.0).position - place) for s in near) < 0.02
    np.testing.assert_allclose(points[0], points[-1], atol=1e-6)
    np.testing.assert_allclose(points[0], places[0], atol=1e-6)


@LAWS
@given(PLACES, st.floats(0.1, 10.0))
def test_the_velocity_is_that_of_the_place(places: np.ndarray, speed: float) -> None:
    path, h = ClosedPath(places), 1e-4
    for s in np.linspace(0.0, path.length, 7):
        here = path.at(s, speed)
        assert np.linalg.norm(here.velocity) == pytest.approx(speed)
        slope = (path.at(s + h, 1.0).position - path.at(s - h + path.length, 1.0).position) / (2 * h)
        np.testing.assert_allclose(slope * speed, here.velocity, atol=0.02 * speed)


def test_a_circle_is_a_circle() -> None:
    angle = 2.0 * np.pi * np.arange(5) / 5
    path = ClosedPath(np.column_stack([4.0 * np.cos(angle), 4.0 * np.sin(angle), np.zeros(5)]))
    assert path.length == pytest.approx(8.0 * np.pi, rel=1e-5)
    assert path.sharpest == pytest.approx(0.25)
    np.testing.assert_allclose(path.at(2.0 * np.pi, 1.0).position, [0.0, 4.0, 0.0], atol=1e-3)


@pytest.mark.parametrize(("name", "speed"), [("walk", 1.5), ("run", 4.0), ("orbit", 1.5)])
def test_the_shipped_paths_keep_their_bounds(name: str, speed: float) -> None:
    """Within 14 m, and no bend takes more than 1.5 m/s²."""
    target = prepare(name, Options()).scenario.target
    assert isinstance(target, PathTarget)
    assert target.speed == speed
    path = ClosedPath(np.array(target.through))
    points = np.array([path.at(s, 1.0).position for s in np.linspace(0.0, path.length, 2001)])
    assert np.abs(points).max() <= 14.0
    assert path.sharpest * speed**2 <= 1.5
    assert target.setting_out <= 1.5


def test_it_says_where_it_is_and_how_fast() -> None:
    config = PathTarget(
        kind="path", through=((10.0, 0.0, 0.0), (0.0, 10.0, 0.0), (-10.0, 0.0, 0.0)), speed=2.0
    )
    walking, codec = Walking(config, FLEET), Codec()
    received = []
    for now in range(0, 10_000_000, 10_000):
        if now == 2_000_000:
            walking.begin(now)
        for datagram in walking.step(now, []):
            received += [(now, message) for message in codec.feed(datagram.data)]
    assert len(received) == 50
    for now, message in received:
        assert isinstance(message, GlobalPosition)
        there = FLEET.to_enu(message.latitude, message.longitude, message.altitude)
        truth = walking.motion(now)
        np.testing.assert_allclose(there, truth.position, atol=0.02)
        np.testing.assert_allclose(ned_to_enu(message.velocity_ned), truth.velocity, atol=0.01)
    speeds = [np.linalg.norm(walking.motion(now).velocity) for now, _ in received]
    assert max(speeds[:10]) == 0.0
    assert speeds[-1] == pytest.approx(2.0)
    # From rest it sets out at 1 m/s².
    assert np.linalg.norm(walking.motion(3_000_000).velocity) == pytest.approx(1.0)
