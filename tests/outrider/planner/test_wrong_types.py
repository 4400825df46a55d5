"""Arguments of wrong types: each is one error, in one line that names it and what is allowed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from outrider import InputError, Neighbour, Obstacle, Planner, PlannerConfig, fly, scenario, sim

AT = (0.0, 0.0, 5.0)
ANY: Any = "x"
NUMBER: Any = 3
WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "config": (lambda: Planner(ANY), "config: is a str; allowed: a PlannerConfig"),
    "surface": (
        lambda: Planner(surface=NUMBER),
        "surface: is a int; allowed: an object with nearest(offset)",
    ),
    "methods": (lambda: Planner(methods=NUMBER), "methods: is a int; allowed: a sequence of"),
    "method": (lambda: Planner(methods=[NUMBER]), "methods: one is a int; allowed: objects with influence("),
    "plan": (lambda: Neighbour(2, AT, plan=ANY), "plan of neighbour 2: is a str; allowed: a Plan, or None"),
    "upright": (
        lambda: Obstacle(AT, 1.0, upright=ANY),
        "upright of an obstacle: is 'x'; allowed: True or False",
    ),
    "neighbours": (
        lambda: Planner().step(0.0, AT, AT, neighbours=NUMBER),
        "neighbours: is a int; allowed: a",
    ),
    "obstacles": (
        lambda: Planner().step(0.0, AT, AT, obstacles=ANY),
        "obstacles: is a str; allowed: a sequence",
    ),
    "packets": (
        lambda: Planner().step(0.0, AT, AT, packets=NUMBER),
        "packets: is a int; allowed: a sequence",
    ),
    "processes": (
        lambda: fly("antipodal-8", processes=0),
        "processes: is 0; allowed: a whole number of at least 1",
    ),
    "seed": (lambda: fly("antipodal-8", seed=ANY), "seed: is 'x'; allowed: a whole number of at least 0"),
    "scenario": (lambda: fly(NUMBER), "scenario: is a int; allowed: a name, a file, or a Scenario"),
    "out": (lambda: fly("antipodal-8", out=NUMBER), "out: is a int; allowed: the path of a new directory"),
    "vehicle": (lambda: sim.Batch(NUMBER), "vehicle: is a int; allowed: a name, a file, or a VehicleConfig"),
    "count": (lambda: sim.Batch("firefly", ANY), "count: is 'x'; allowed: a whole number of at least 1"),
    "ground": (lambda: sim.Batch(ground=ANY), "ground: is no number; allowed: a finite number, m"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_type_is_one_line_with_what_is_allowed(what: str) -> None:
    call, said = WRONG[what]
    with pytest.raises(InputError) as raised:
        call()
    assert str(raised.value).startswith(said)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"avoidance": "x"}, "avoidance is 'x'; allowed: 'field', 'certified'"),
        ({"methods": ["swivl"]}, "methods[0] is 'swivl'; allowed: 'baseline', 'swivel', 'approach_angle', "),
        ({"horizon": {"steps": -1}}, "horizon.steps is -1; allowed: a whole number ≥ 2 and ≤ 15"),
        ({"methodz": 1}, "'methodz' is unknown; allowed: task, methods, "),
        ({"field": 3}, "field is 3; allowed: a mapping optionally with gain, d_min"),
        ({"obstacles": [object()]}, "obstacles[0] is "),
    ],
)
def test_a_wrong_setting_is_one_line_with_what_is_allowed(values: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as raised:
        PlannerConfig(**values)
    assert str(raised.value).startswith(f"PlannerConfig: {said}")
    assert "\n" not in str(raised.value)
    assert raised.value.__suppress_context__


def test_every_wrong_setting_has_its_line() -> None:
    with pytest.raises(InputError) as raised:
        PlannerConfig(avoidance="x", planar="maybe")
    assert len(str(raised.value).splitlines()) == 2


def test_the_settings_of_a_scenario_are_a_planners() -> None:
    assert Planner(scenario("antipodal-8").companion).config.methods == ("tangential",)
