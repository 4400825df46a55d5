"""What cannot work is refused with its reason before it flies; what is shipped can work."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from outrider.errors import InputError
from outrider.scenarios.feasibility import check_drawn, obstacles_to
from outrider.scenarios.starts import starts
from outrider.simulation.preparation import measured, prepared
from tests.outrider.shipped import FIREFLY, SCENARIOS, scenario


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_shipped_scenario_can_work(name: str) -> None:
    assert not list(obstacles_to(scenario(name), FIREFLY.span))


POINTS = {"kind": "points", "jitter": 0.0}
BOX = {"kind": "box", "at": [9, 0, 5], "size": [2, 2, 2]}
GOTO: dict[str, Any] = {"task": "goto", "vehicles": 2}
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "starts in each other": (
        {"starts": {**POINTS, "at": [[0, 0, 5], [0.5, 0, 5]], "goals": [[5, 0, 5], [0, 5, 5]]}},
        "vehicles 11 and 12 start 0.50 m from each other",
    ),
    "goals in each other": (
        {"starts": {**POINTS, "at": [[0, 0, 5], [3, 0, 5]], "goals": [[5, 0, 5], [5, 0, 5.2]]}},
        "vehicles 11 and 12 have goals 0.20 m from each other",
    ),
    "a start outside": (
        {"starts": {**POINTS, "at": [[0, 0, 5], [30, 0, 5]], "goals": [[5, 0, 5], [0, 5, 5]]}},
        "vehicle 12 starts 30 m east, outside companion.limits; allowed: -",
    ),
    "a goal below": (
        {"starts": {**POINTS, "at": [[0, 0, 5], [3, 0, 5]], "goals": [[5, 0, 0.5], [0, 5, 5]]}},
        "vehicle 11 has its goal 0.5 m up, outside companion.limits",
    ),
    "no room": (
        {
            "starts": {**POINTS, "at": [[0, 0, 5], [3, 0, 5]], "goals": [[3, 0, 5], [0, 0, 5]]},
            "d_min": 8.0,
            "companion": {"limits": {"box_min": [-1, -1, 4], "box_max": [4, 1, 6]}},
        },
        "has no room for 2 vehicles that keep d_min = 8 m",
    ),
    "a start inside a box": (
        {
            "starts": {**POINTS, "at": [[0, 0, 5], [9, 0, 5]], "goals": [[-5, 0, 5], [-9, 5, 5]]},
            "obstacles": [{"kind": "sphere", "at": [0, 9, 5], "radius": 1}, BOX],
        },
        "vehicle 12 starts at [9, 0, 5] inside obstacles[1], a box at [9, 0, 5]; allowed: at least"
        " d_min_obstacle = 0.5 m from it",
    ),
    "a start above a box": (
        {
            "starts": {**POINTS, "at": [[0, 0, 8], [9, 0, 8]], "goals": [[-5, 0, 5], [-9, 5, 5]]},
            "obstacles": [BOX],
        },
        "vehicle 12 starts at [9, 0, 8] inside obstacles[0]",
    ),
    "a goal at a wall": (
        {
            "starts": {**POINTS, "at": [[0, 0, 5], [9, 0, 5]], "goals": [[-5, 0, 5], [-9, 5, 5]]},
            "obstacles": [{"kind": "wall", "ends": [[-5.5, -5], [-5.5, 5]]}],
        },
        "vehicle 11 has its goal at [-5, 0, 5] 0.40 m from obstacles[0], a wall from [-5.5, -5] to [-5.5, 5]",
    ),
    "a goal at a post": (
        {
            "starts": {**POINTS, "at": [[0, 0, 5], [9, 0, 5]], "goals": [[-5, 0, 5], [-9, 5, 5]]},
            "obstacles": [{"kind": "post", "at": [-5, 1], "radius": 0.7}],
        },
        "vehicle 11 has its goal at [-5, 0, 5] 0.30 m from obstacles[0], a post at [-5, 1]",
    ),
    "a box over a start": (
        {
            "starts": {**POINTS, "at": [[0, 0, 5], [9, 0, 9]], "goals": [[-5, 0, 5], [-9, 5, 5]]},
            "obstacles": [BOX],
        },
        "vehicle 12 starts at [9, 0, 9] inside obstacles[0], a box at [9, 0, 5]",
    ),
    "a box beside a column": (
        {
            "starts": {**POINTS, "at": [[0, 0, 5], [10.7, 0, 9]], "goals": [[-5, 0, 5], [-9, 5, 5]]},
            "obstacles": [BOX],
            "companion": {"avoidance": "certified", "certified": {"drift": 0.4}},
        },
        "vehicle 12 takes off, within certified.drift = 0.4 m of its start, at [10.7, 0, 9] 0.30 m from"
        " obstacles[0], a box at [9, 0, 5]; allowed: at least d_min_obstacle = 0.5 m",
    ),
    "more than vehicles keep": (
        {
            "starts": {**POINTS, "at": [[0, 0, 5], [9, 0, 5]], "goals": [[-5, 0, 5], [-9, 5, 5]]},
            "d_min": 0.7,
            "companion": {"field": {"d_min": 0.6}},
        },
        "d_min: 0.7 m is more than vehicles keep, companion.field.d_min = 0.6 m; allowed: at most 0.6",
    ),
    "a world that was not read": (
        {
            "starts": {**POINTS, "at": [[0, 0, 5], [9, 0, 5]], "goals": [[-5, 0, 5], [-9, 5, 5]]},
            "world": "w.csv",
        },
        "world: w.csv was not read; allowed: in a scenario file only",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_cannot_work_is_refused_with_the_reason(what: str) -> None:
    changes, said = WRONG[what]
    with pytest.raises(InputError) as error:
        prepared(scenario("obstacles", **{**GOTO, **changes}), "mine.yaml")
    assert str(error.value).startswith("mine.yaml: ")
    assert said in str(error.value)


def test_a_start_and_a_goal_beside_obstacles_can_work_and_in_the_air_also_above_one() -> None:
    places = {"at": [[0, 0, 8], [9, 0, 8]], "goals": [[-5, 0, 5], [9, 0, 8]]}
    above = scenario("obstacles", **GOTO, starts={**POINTS, **places}, obstacles=[BOX], airborne=True)
    assert not list(obstacles_to(above, FIREFLY.span))


def test_the_column_has_to_be_free_only_where_an_autopilot_climbs_in_it() -> None:
    """0.7 m beside a box below the start: in the field, in the air, or with a narrower column it can work."""
    places = {"at": [[0, 0, 5], [10.7, 0, 9]], "goals": [[-5, 0, 5], [-9, 5, 5]]}
    changes: dict[str, Any] = {**GOTO, "starts": {**POINTS, **places}, "obstacles": [BOX]}
    committed = {"avoidance": "certified", "certified": {"drift": 0.4}}
    narrow = {"avoidance": "certified", "certified": {"drift": 0.15, "tube": 0.1}}
    for more in ({}, {"companion": committed, "airborne": True}, {"companion": narrow}):
        assert not list(obstacles_to(scenario("obstacles", **changes, **more), FIREFLY.span))


def test_above_a_post_only_the_field_can_work() -> None:
    """The planes of committed plans keep beside a post at every height, and nothing would keep above it."""
    post = {"kind": "post", "at": [9, 0], "radius": 1, "height": 4}
    places = {"at": [[0, 0, 8], [9, 0, 8]], "goals": [[-5, 0, 5], [9, 5, 8]]}
    changes = {**GOTO, "starts": {**POINTS, **places}, "obstacles": [post], "airborne": True}
    assert not list(obstacles_to(scenario("obstacles", **changes), FIREFLY.span))
    committed = scenario("obstacles", **changes, companion={"avoidance": "certified"})
    found = list(obstacles_to(committed, FIREFLY.span))
    assert len(found) == 1
    assert "vehicle 12 starts at [9, 0, 8] above or inside obstacles[0], a post at [9, 0]" in found[0]


def test_a_start_that_its_jitter_moves_too_near_is_refused_for_that_seed() -> None:
    """Of two seeds one draws a start beside the box, the other one that is clear of it."""
    at = {"at": [[0, 0, 5], [7.45, 0, 5]], "goals": [[0, 5, 5], [5, 5, 5]]}
    jittered = scenario("obstacles", **GOTO, starts={**POINTS, **at, "jitter": 0.4}, obstacles=[BOX])
    flown = prepared(jittered, "mine.yaml")
    drawn = [float(starts(jittered, seed, planar=False).positions[1, 0]) for seed in range(8)]
    near = int(np.argmax(drawn))
    assert drawn[near] > 7.5
    with pytest.raises(InputError, match=rf"seed {near}: vehicle 12 starts at .* m from obstacles\[0\]"):
        measured(flown, near)
    clear = int(np.argmin(drawn))
    check_drawn(jittered, clear, starts(jittered, clear, planar=False).positions)
