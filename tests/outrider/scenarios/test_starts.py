"""Where vehicles start and where they must go: geometry and seeds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.scenarios.scenario import Ring, Scenario
from outrider.scenarios.starts import starts
from tests.outrider.shipped import scenario

SEEDS = st.integers(0, 2**63)


def ring(count: int, jitter: float, task: str = "antipodal", **changes: Any) -> Scenario:
    name = "antipodal-8" if task == "antipodal" else "scenario-1"
    return scenario(name, vehicles=count, starts={"jitter": jitter, **changes})


def slots(of: Scenario) -> np.ndarray:
    """Without jitter."""
    still = of.model_copy(update={"starts": of.starts.model_copy(update={"jitter": 0.0})})
    return starts(still, 0, False).positions


@settings(deadline=None)
@given(
    SEEDS,
    st.integers(1, 12),
    st.floats(0.0, 2.0),
    st.booleans(),
    st.sampled_from(["antipodal", "escort"]),
)
def test_jitter_stays_within_its_ball(seed: int, count: int, jitter: float, planar: bool, task: str) -> None:
    of = ring(count, jitter, task)
    moved = starts(of, seed, planar).positions - slots(of)
    assert moved.shape == (count, 3)
    assert np.linalg.norm(moved, axis=1).max() <= jitter + 1e-9
    if planar:
        assert not moved[:, 2].any()


@settings(deadline=None)
@given(SEEDS, st.integers(2, 12), st.booleans())
def test_the_seed_alone_decides(seed: int, count: int, planar: bool) -> None:
    of = ring(count, 0.3)
    first, again = starts(of, seed, planar), starts(of, seed, planar)
    other = starts(of, seed + 1, planar)
    assert np.array_equal(first.positions, again.positions)
    assert not np.isclose(first.positions, other.positions).all(axis=1).any()
    assert first.goals is not None
    assert other.goals is not None
    assert np.array_equal(first.goals, other.goals)


@settings(deadline=None)
@given(SEEDS, st.integers(2, 60), st.floats(0.0, 1.0), st.floats(0.5, 8.0))
def test_a_ring_has_room_for_all(seed: int, count: int, jitter: float, apart: float) -> None:
    of = ring(count, jitter, radius=8.0, apart=apart)
    places = starts(of, seed, False).positions
    off = np.linalg.norm(places[:, None] - places[None], axis=-1) + 1e9 * np.eye(count)
    assert off.min() >= apart - 1e-9
    # No larger than it must be, and never smaller than it is said to be.
    assert isinstance(of.starts, Ring)
    radius = of.starts.radius_of(count)
    assert np.abs(np.linalg.norm(places[:, :2], axis=1) - radius).max() <= jitter + 1e-9
    needed = (apart + 2.0 * jitter) / (2.0 * np.sin(np.pi / count))
    assert radius == pytest.approx(max(8.0, needed))


def test_jitter_fills_the_ball_evenly() -> None:
    of = ring(200, 1.0)
    offsets = np.concatenate([starts(of, seed, False).positions - slots(of) for seed in range(20)])
    radii = np.linalg.norm(offsets, axis=1)
    # Of a ball's volume an eighth lies within half its radius.
    assert (radii < 0.5).mean() == pytest.approx(0.125, abs=0.02)
    assert np.abs(offsets.mean(axis=0)).max() < 0.03
    assert np.abs(offsets.std(axis=0) - np.sqrt(0.2)).max() < 0.02


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("centre", [(0.0, 0.0), (-8.0, 3.0)])
def test_slots_lie_evenly_on_the_ring(count: int, centre: tuple[float, float]) -> None:
    of = ring(count, 0.0, centre=centre, radius=7.0, height=6.0, first_deg=30.0)
    offset = starts(of, 1, False).positions - (*centre, 6.0)
    assert np.allclose(np.linalg.norm(offset, axis=1), 7.0)
    bearings = np.degrees(np.arctan2(offset[:, 1], offset[:, 0]))
    assert np.allclose((bearings - 30.0) % 360.0 % 360.0, 360.0 * np.arange(count) / count)


@settings(deadline=None)
@given(SEEDS, st.integers(1, 12), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_the_goal_is_opposite_to_the_slot_not_to_the_jittered_start(
    seed: int, count: int, east: float, north: float
) -> None:
    of = ring(count, 1.5, centre=(east, north))
    goals = starts(of, seed, False).goals
    assert goals is not None
    middle = (goals + slots(of)) / 2.0
    assert np.allclose(middle, (east, north, of.starts.height))


@pytest.mark.parametrize("count", [2, 4, 8])
def test_an_even_fleet_swaps_places(count: int) -> None:
    of = ring(count, 0.0)
    there = starts(of, 1, False)
    assert there.goals is not None
    half = count // 2
    assert np.allclose(there.goals, np.roll(there.positions, -half, axis=0))


def test_escorts_have_no_goal_of_their_own() -> None:
    assert starts(ring(5, 0.3, "escort"), 1, False).goals is None
    assert starts(scenario("escort"), 1, False).goals is None
