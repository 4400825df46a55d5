"""What cannot work is refused with its reason before it flies; what is shipped can work."""

from __future__ import annotations

from typing import Any

import pytest

from outrider.errors import InputError
from outrider.scenarios.feasibility import obstacles_to
from outrider.simulation.preparation import prepared
from tests.outrider.shipped import FIREFLY, SCENARIOS, scenario


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_shipped_scenario_can_work(name: str) -> None:
    assert not list(obstacles_to(scenario(name), FIREFLY.span))


POINTS = {"kind": "points", "jitter": 0.0}
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
}


@pytest.mark.parametrize("what", WRONG)
def test_what_cannot_work_is_refused_with_the_reason(what: str) -> None:
    changes, said = WRONG[what]
    with pytest.raises(InputError) as error:
        prepared(scenario("obstacles", **{**GOTO, **changes}), "mine.yaml")
    assert str(error.value).startswith("mine.yaml: ")
    assert said in str(error.value)
