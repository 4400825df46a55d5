"""Scenes: what stands in the way is flown around, a target that jumps is followed each time, and the shipped
scenarios of a rough world end well."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.obstacles.static import FixedObstacles
from mavlink_bridge.messages import GlobalPosition
from outrider.runs.formation_error import standoff
from outrider.runs.names import LINK_NUMBERS
from outrider.runs.summary import exit_status
from tests.scenarios.flight_facts import arrived, check_told, clock, log
from tests.scenarios.lockstep_flights import FIREFLY, Flown, check, fly, scenario

BLOCKED: dict[str, Any] = {
    "vehicles": 3,
    "airborne": True,
    "cap_s": 25.0,
    "task": "goto",
    "starts": {
        "kind": "points",
        "at": [[-9.0, 0.0, 5.0], [-9.0, 6.0, 5.0], [9.0, -6.0, 5.0]],
        "goals": [[9.0, 0.0, 5.0], [9.0, 6.0, 5.0], [-9.0, -6.0, 5.0]],
    },
    "obstacles": [
        {"kind": "post", "at": [0.0, 0.1], "radius": 0.4},
        {"kind": "sphere", "at": [1.0, 5.9, 5.2], "radius": 0.8},
        {"kind": "post", "at": [-1.0, -6.2], "radius": 0.5, "height": 5.5},
    ],
}
"""Three lanes, and something on each."""
ROUGH = {"sensors": "rtk", "weather": {"wind": [0.0, 4.0, 0.0], "turbulence": "light"}}


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{}, ROUGH], ids=["calm", "rtk, wind"])
def test_what_stands_in_the_way_is_not_touched(changes: dict[str, Any], tmp_path: Path) -> None:
    of = scenario("antipodal-8", BLOCKED, changes)
    flown = fly(of, 1, tmp_path)
    check_told(flown)
    starts = flown.flight.fleet.starts
    assert starts.goals is not None
    fixed = FixedObstacles(of.obstacles)
    share = np.linspace(0.0, 1.0, 1_000)[:, None, None]
    straight = fixed.distance(starts.positions + share * (starts.goals - starts.positions))
    # Who flew straight would run into it.
    assert (straight.min(axis=(0, 2)) < 0.0).all()
    flown_past = fixed.distance(flown.flight.truth.samples().position)
    assert (flown_past.min(axis=(0, 2)) > of.d_min_obstacle).all()
    least = flown.summary["min_obstacle_distance_m"]
    assert isinstance(least, float)
    assert FIREFLY.span / 2 < of.d_min_obstacle < least <= flown_past.min() + 1e-4
    assert flown.summary["d_min_violations"] == 0
    assert all(arrived(flown))
    assert exit_status(flown.summary) == 0


@pytest.mark.slow
def test_who_starts_too_near_is_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """0.4 m from a post are one encounter, though the vehicle leaves at once. Other flights refuse it."""
    monkeypatch.setattr("outrider.simulation.flight.check_drawn", lambda *_: None)
    changes = {
        "vehicles": 1,
        "cap_s": 1.0,
        "starts": {"kind": "points", "at": [[0.0, 0.0, 5.0]], "goals": [[0.0, 0.0, 5.0]]},
        "obstacles": [{"kind": "post", "at": [0.9, 0.0], "radius": 0.5}],
    }
    flown = fly(scenario("antipodal-8", BLOCKED, changes), 1, tmp_path)
    assert flown.summary["d_min_violations"] == 1
    assert flown.summary["min_obstacle_distance_m"] == pytest.approx(0.4, abs=0.02)
    assert exit_status(flown.summary) == 1


JUMPS = ((0.0, (2.0, 0.0, 0.0)), (2.0, (-6.0, 6.0, 0.0)), (12.0, (4.0, 6.0, 0.0)))
"""Seconds after the goal event, and where to; each is 10 m, which no track takes for noise."""
HOPPING = {
    "vehicles": 2,
    "airborne": True,
    "target": {
        "jump_to": JUMPS[0][1],
        "jumps": [{"after_s": after, "to": place} for after, place in JUMPS[1:]],
    },
}


@pytest.mark.slow
def test_a_target_that_jumps_is_followed_each_time(tmp_path: Path) -> None:
    of = scenario("scenario-1", HOPPING)
    flown = fly(of, 1, tmp_path)
    check_told(flown)
    samples, times = clock(flown)
    # True places: at every sample after the goal event the newest of those whose time has come.
    expected = [max(jump for jump in JUMPS if jump[0] <= time + 1e-6)[1] for time in times[1:]]
    assert np.array_equal(samples.target[1:], expected)
    error = standoff(of, samples.position, samples.target)
    speed = np.linalg.norm(samples.velocity, axis=-1)
    for jump, _ in JUMPS:
        assert error[(times > jump) & (times < jump + 0.1)].max() > 1.0
        assert speed[(times > jump) & (times < jump + 2.0)].max() > 1.0
    # They rested where they had to be before the last jump; that does not count.
    before = (times > 11.0) & (times < 12.0)
    assert error[before].max() < 0.3
    assert speed[before].max() < 0.3
    assert error[-1].max() < 0.3
    seconds = flown.summary["convergence_time_s"]
    assert isinstance(seconds, float)
    assert 12.0 < seconds < 25.0
    assert exit_status(flown.summary) == 0
    check_heard(flown, [time for time, _ in JUMPS])


def check_heard(flown: Flown, jumps: list[float]) -> None:
    """The target says at once that it has jumped: a message is heard the delay of its link later."""
    received = np.array(
        [
            h.time
            for h in log(flown, 11)
            if h.link == LINK_NUMBERS["target"] and isinstance(h.message, GlobalPosition)
        ]
    )
    for jump in jumps:
        after = received[received > jump]
        assert after[0] - jump < 0.06


@pytest.mark.slow
def test_the_shipped_rough_world(tmp_path: Path) -> None:
    """From the ground to the ground."""
    flown = fly(scenario("rough"), 1, tmp_path)
    check(flown)
    assert flown.summary["converged"] is True
    assert exit_status(flown.summary) == 0


@pytest.mark.slow
def test_the_shipped_obstacles(tmp_path: Path) -> None:
    flown = fly(scenario("obstacles"), 1, tmp_path)
    check(flown)
    assert flown.summary["converged"] is True
    assert flown.flight.truth.obstacles.minimum > flown.flight.scenario.d_min_obstacle
    assert exit_status(flown.summary) == 0
