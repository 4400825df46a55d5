"""The scenes of the benchmarks: a seed decides them, and ``outrider`` flies the same."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.scenes import APART, HEIGHT, SCENES, SIDE, VEHICLES, crowd, places, scattered
from outrider.errors import InputError
from outrider.resources import config_root, find
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.starts import Starts, starts
from outrider.simulation.fleet import Fleet
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig

SEEDS = st.integers(0, 2**31)


def same(one: Starts, other: Starts) -> bool:
    assert one.goals is not None
    assert other.goals is not None
    return np.array_equal(one.positions, other.positions) and np.array_equal(one.goals, other.goals)


@pytest.mark.parametrize("name", SCENES)
@given(seed=SEEDS)
def test_the_seed_alone_decides(name: str, seed: int) -> None:
    first, again, other = (places(SCENES[name](one), one) for one in (seed, seed, seed + 1))
    assert same(first, again)
    assert not np.isclose(first.positions, other.positions).all(axis=1).any()


@pytest.mark.parametrize("name", SCENES)
def test_a_fleet_begins_where_a_benchmark_does(name: str) -> None:
    of = SCENES[name](3)
    fleet = Fleet(of, load(find("vehicles", of.vehicle), VehicleConfig), 3, config_root() / "logs")
    assert same(places(of, 3), fleet.starts)


@pytest.mark.parametrize(("name", "radius"), [("antipodal-8", 8.0), ("antipodal-16", 12.0)])
@given(seed=SEEDS)
def test_a_swap_is_the_shipped_one(name: str, radius: float, seed: int) -> None:
    there = places(SCENES[name](seed), seed)
    assert same(there, starts(load(find("scenarios", name), Scenario), seed, False))
    assert there.goals is not None
    assert np.allclose(np.linalg.norm(there.goals - (0.0, 0.0, HEIGHT), axis=1), radius)
    opposite = (0.0, 0.0, 2.0 * HEIGHT) - there.goals
    assert np.linalg.norm(there.positions - opposite, axis=1).max() <= 0.3 + 1e-9


@given(SEEDS)
def test_a_crowd_has_room(seed: int) -> None:
    there = places(crowd(seed), seed)
    assert there.goals is not None
    assert not np.array_equal(there.positions, there.goals)
    for found in there:
        assert found.shape == (VEHICLES, 3)
        assert np.abs(found[:, :2]).max() <= SIDE / 2.0
        assert (found[:, 2] == HEIGHT).all()
        apart = np.linalg.norm(found[:, None] - found[None], axis=-1) + 1e9 * np.eye(VEHICLES)
        assert apart.min() >= APART


def test_a_square_may_be_too_small() -> None:
    with pytest.raises(InputError, match="5 places 3 m apart"):
        scattered(np.random.default_rng(1), count=5, side=2.0, apart=3.0)


def test_the_crowd_that_was_measured_is_drawn_again() -> None:
    """Published figures are of these places."""
    there = places(crowd(1), 1)
    assert there.goals is not None
    assert there.positions[0].tolist() == [-4.27, 4.975, HEIGHT]
    assert there.goals[-1].tolist() == [2.084, 0.913, HEIGHT]
