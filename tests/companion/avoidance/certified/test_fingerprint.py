"""Fingerprint of what two vehicles must have in common: each of these settings changes it, no other does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.fingerprint import fingerprint, identity
from companion.config import CompanionConfig
from mavlink_bridge.frames import FleetFrame
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import FLEET, Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm

SETTINGS: dict[str, Any] = {
    "avoidance": "certified",
    "certified": {"fleet": [1, 2, 3], "time_sources": {"autopilot_us": 3000}, "fleet_time": "measured"},
    "field": {"d_min": 0.5, "d_safe": 3.0, "position_sigma": 0.02},
    "limits": {"v_max": [5.0, 5.0, 4.0]},
}


def changed(change: dict[str, Any], settings: dict[str, Any] = SETTINGS) -> dict[str, Any]:
    """The settings with those of ``change`` in their place, part by part."""
    found = dict(settings)
    for name, value in change.items():
        found[name] = changed(value, found.get(name, {})) if isinstance(value, dict) else value
    return found


def printed(change: dict[str, Any] | None = None, frame: FleetFrame = FLEET) -> int:
    return fingerprint(CompanionConfig.model_validate(changed(change or {})), frame)


COMMON: dict[str, dict[str, Any]] = {
    "knots": {"certified": {"dt_us": 110_000}},
    "segments": {"horizon": {"steps": 14}},
    "epochs": {"certified": {"epoch_us": 440_000}},
    "heights": {"planar": True},
    "d_min": {"field": {"d_min": 0.5001}},
    "downwash": {"field": {"downwash": 2.0}},
    "tube": {"certified": {"tube": 0.2501}},
    "drift": {"certified": {"drift": 0.5001}},
    "k": {"certified": {"sigmas": 3.001}},
    "sigma": {"field": {"position_sigma": 0.0201}},
    "speed": {"limits": {"v_max": [5.0, 5.001, 4.0]}},
    "speed of climb": {"limits": {"v_max": [5.0, 5.0, 4.001]}},
    "speed of descent": {"limits": {"v_min": [-5.0, -5.0, -4.5]}},
    "clocks": {"certified": {"clock_us": 5_001}},
    "planes": {"certified": {"plane_shift": 0.74}},
    "own clock": {"certified": {"fleet_time": "own"}},
    "reference": {"certified": {"time_sources": {"reference": 2}}},
    "another reference": {"certified": {"time_sources": {"reference": 3}}},
    "one more": {"certified": {"fleet": [1, 2, 3, 4]}},
    "one less": {"certified": {"fleet": [1, 2]}},
    "nobody named": {"certified": {"fleet": []}},
    "range": {"certified": {"range": 80.0}},
    "another range": {"certified": {"range": 81.0}},
    "contact": {"certified": {"range": 80.0, "contact_us": 400_000}},
}
OF_ONE: dict[str, dict[str, Any]] = {
    "acceleration": {"limits": {"u_max": [1.0, 1.0, 1.0], "a_total": 6.0}},
    "slow descent": {"limits": {"v_min": [-5.0, -5.0, -1.0], "u_min": [-2.0, -2.0, -1.0]}},
    "box": {"limits": {"box_min": [-9.0, -9.0, 2.0]}},
    "strangers": {"certified": {"noncooperative_speed": 3.0, "noncooperative_acceleration": 2.0}},
    "cost": {"certified": {"omega_field": 0.1, "spare": 0.02}},
    "repetition": {"certified": {"repeat_in_loss": 1.0}},
    "times": {"certified": {"repeat_us": 40_000, "lead_us": 40_000, "gone_us": 500_000, "last_call_us": 0}},
    "sources": {"certified": {"time_sources": {"autopilot_us": 9, "drift_ppm": 1, "wrong": 0}}},
    "field": {"field": {"gain": 5.0, "d_safe": 4.0, "margin_sigmas": 3.0}},
    "sense": {"turning_sense": "right", "methods": ["swivel"]},
    "surface": {"surface": {"radius": 9.0}},
    "order": {"certified": {"fleet": [3, 1, 2, 1]}},
}


@pytest.mark.parametrize("name", COMMON)
def test_each_setting_that_is_common_changes_it(name: str) -> None:
    assert printed(COMMON[name]) != printed()


def test_no_two_of_these_changes_give_the_same() -> None:
    assert len({printed(), *(printed(change) for change in COMMON.values())}) == len(COMMON) + 1


@pytest.mark.parametrize("name", OF_ONE)
def test_no_setting_of_one_vehicle_alone_changes_it(name: str) -> None:
    assert printed(OF_ONE[name]) == printed()


@pytest.mark.parametrize("moved", [(1e-8, 0.0, 0.0), (0.0, -1e-8, 0.0), (0.0, 0.0, 1e-3)])
def test_an_origin_a_millimetre_away_changes_it(moved: tuple[float, float, float]) -> None:
    frame = FleetFrame(FLEET.latitude + moved[0], FLEET.longitude + moved[1], FLEET.altitude + moved[2])
    assert printed(frame=frame) != printed()


@given(st.floats(0.01, 100.0), st.integers(-3, 3))
def test_the_last_digits_of_a_number_do_not_matter_and_a_micrometre_does(tube: float, ulps: int) -> None:
    """A number that was written and read, or computed in another order, is off by some units in the last
    place."""
    on_grid = round(tube, 5)
    near = on_grid
    for _ in range(abs(ulps)):
        near = float(np.nextafter(near, np.inf if ulps > 0 else 0.0))
    assert printed({"certified": {"tube": near}}) == printed({"certified": {"tube": on_grid}})
    assert printed({"certified": {"tube": on_grid + 1e-6}}) != printed({"certified": {"tube": on_grid}})


@given(st.permutations(range(1, 9)))
def test_the_order_of_the_fleet_does_not_matter(fleet: list[int]) -> None:
    assert printed({"certified": {"fleet": fleet}}) == printed({"certified": {"fleet": list(range(1, 9))}})


def test_plans_carry_the_fingerprint_of_the_frame() -> None:
    config = CompanionConfig.model_validate(SETTINGS)
    assert identity(config, FLEET) == (fingerprint(config, FLEET), FLEET.fingerprint)


# In a swarm


def goals(since: int, system: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([8.0, 6.0 * system, 5.0])


DURATION = 8_000_000
ENDS = EPOCH + DURATION
STARTS = np.array([[0.0, 6.0 * system, 5.0] for system in (1, 2, 3)])


@pytest.mark.parametrize("loss", [0.0, 0.5])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nobody_agrees_with_a_vehicle_of_another_fingerprint(loss: float, seed: int) -> None:
    """The two others agree with each other and fly on; all three report it."""
    swarm = Swarm(
        STARTS,
        Rough(loss=loss, delay=50_000),
        [Habits()] * 3,
        seed,
        strangers=True,
        others={3: {"tube": 0.3}},
    )
    swarm.run(DURATION, goals)
    one, two, other = (vehicle.flight.agreements for vehicle in swarm.vehicles)
    assert not any(kept.system == 3 or kept.other == 3 for kept in swarm.kept)
    assert not swarm.faults()
    assert one.refused_senders(ENDS).differing == two.refused_senders(ENDS).differing == (3,)
    assert other.refused_senders(ENDS).differing == (1, 2)
    assert (one.peers.members, two.peers.members) == ({2}, {1})
    arrived = [swarm.vehicles[k].plan(max(swarm.epochs())).position_m for k in (0, 1)]
    assert np.abs(np.array(arrived) - [goals(0, 1), goals(0, 2)]).max() < 0.5


def test_nobody_moves_while_an_expected_vehicle_has_another_fingerprint() -> None:
    swarm = Swarm(STARTS, Rough(), [Habits()] * 3, 1, others={2: {"clock_us": 6_000}})
    swarm.run(DURATION, goals)
    assert not swarm.made()
    for vehicle in swarm.vehicles:
        agreements = vehicle.flight.agreements
        others = {1, 3} if vehicle.system == 2 else {2}
        assert agreements.missing() == set(agreements.refused_senders(ENDS).differing) == others
