"""Sweep files, the cells they span, and what is refused before anything is flown."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.errors import InputError
from outrider.resources import config_root
from outrider.scenarios.scenario import Scenario
from outrider.sweep.cells import cells, scenario_of, scenario_text, task
from outrider.sweep.grid import MOST_CELLS, Sweep, axis_keys, leaves, overlay, points
from outrider.yaml_files.yaml_file import load, read
from tests.outrider.shipped import SCENARIOS, scenario

SWEEPS = sorted((config_root() / "sweeps").glob("*.yaml"))
KEYS = st.text("abc", min_size=1, max_size=2)
DOCUMENTS = st.recursive(
    st.integers() | st.booleans() | st.text(max_size=3),
    lambda inner: st.dictionaries(KEYS, inner, min_size=1, max_size=3),
    max_leaves=8,
).filter(lambda value: isinstance(value, dict))


def sweep(**keys: Any) -> Sweep:
    return Sweep.model_validate({"name": "test", "scenarios": ["antipodal-8"], "runs": 2, **keys})


def refused(**keys: Any) -> str:
    with pytest.raises(InputError) as caught:
        cells(sweep(**keys), "test.yaml")
    return str(caught.value)


# Shipped files


@pytest.mark.parametrize("path", SWEEPS, ids=lambda path: path.stem)
def test_a_shipped_sweep_can_be_flown(path: Path) -> None:
    spec = load(path, Sweep)
    assert spec.name == path.stem
    found = cells(spec.model_copy(update={"runs": 5}), str(path))
    assert len(found) == len(list(points(spec)))
    for cell in found:
        assert scenario_of(task(cell, spec.first_seed)).airborne


@given(
    st.dictionaries(
        KEYS.map(lambda k: f"x.{k}"), st.lists(st.integers(), min_size=1, max_size=3), max_size=2
    ),
    st.dictionaries(
        KEYS.map(lambda k: f"y.{k}"), st.lists(st.integers(), min_size=1, max_size=3), max_size=3
    ),
)
def test_what_varies_is_one_thing_at_a_time(grid: dict[str, list[int]], vary: dict[str, list[int]]) -> None:
    found = [point.changes for point in points(sweep(grid=grid, vary=vary, set={"z": 1}))]
    bases = [point.changes for point in points(sweep(grid=grid, set={"z": 1}))]
    assert len(found) == len(bases) * (1 + sum(len(values) for values in vary.values()))
    assert [changes for changes in found if not any(key in vary for key in changes)] == bases
    for changes in found:
        aside = {key: value for key, value in changes.items() if key in vary}
        assert len(aside) <= 1
        assert {key: value for key, value in changes.items() if key not in vary} in bases
        assert all(value in vary[key] for key, value in aside.items())


def test_the_bar_s_sweep_is_a_thousand_seeds_at_20_hz() -> None:
    spec = load(config_root() / "sweeps" / "antipodal-8.yaml", Sweep)
    (cell,) = cells(spec.model_copy(update={"runs": 1}), "x")
    flown = scenario_of(task(cell, 1))
    assert (spec.runs, flown.vehicles, flown.companion.rates.replan_us) == (1000, 8, 50_000)
    assert flown.companion.methods == ("tangential",)


# The model


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name: a\nscenarios: [x]\ngird: {}\n", "a.yaml:3:1: 'gird' is unknown"),
        ("name: a\nscenarios: [x]\ngird: {}\n", "did you mean 'grid'?"),
        ("name: a\n", "needs either scenarios or scenes"),
        ("name: a\nscenarios: [x]\nscenes: [y]\n", "needs either scenarios or scenes"),
        ("name: a\nscenarios: [x]\nruns: 0\n", "a.yaml:3:7: runs is 0"),
        ("name: a\nscenarios: [x]\ngrid: {a.b: []}\n", "a.yaml:3"),
        ("name: a\nscenarios: [x]\ngrid: {a..b: [1]}\n", "a.yaml:3"),
        ("name: a\nscenarios: [x]\nset: {a.b: 1}\ngrid: {a.b: [1]}\n", "a.b: set in two places"),
        ("name: a\nscenarios: [x]\ngrid: {a.b: [1], a: [{}]}\n", "a.b: set in two places"),
        ("name: a\nscenarios: [x]\ngrid: {a + b: [1], b: [1]}\n", "b: set in two places"),
        ("name: a\nscenarios: [x]\nset: {a: 1}\nvary: {a: [1]}\n", "a: set in two places"),
        ("name: a\nscenarios: [x]\ngrid: {a: [1]}\nvary: {a.b: [1]}\n", "a.b: set in two places"),
        ("name: a/b\nscenarios: [x]\n", "a.yaml:1:7"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_with_its_place(text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        read(text.encode(), "a.yaml", Sweep)
    assert said in str(caught.value)


def test_a_grid_has_an_end() -> None:
    values = list(range(MOST_CELLS // 10 + 1))
    with pytest.raises(ValueError, match=f"allowed are {MOST_CELLS}"):
        sweep(grid={"a": values, "b": list(range(10))})


# Combinations


@settings(max_examples=50)
@given(
    st.dictionaries(
        st.sampled_from(["b", "a.b", "c.a.b", "c.d + d", "x.y"]),
        st.lists(st.integers(), min_size=1, max_size=3),
    )
)
def test_every_combination_is_there_once_with_a_label_of_its_own(grid: dict[str, list[int]]) -> None:
    grid = {axis: list(dict.fromkeys(values)) for axis, values in grid.items()}
    found = list(points(sweep(grid=grid)))
    count = 1
    for values in grid.values():
        count *= len(values)
    assert len(found) == count
    assert len({point.label for point in found}) == count
    assert len({tuple(point.changes.items()) for point in found}) == count
    for point in found:
        for axis, values in grid.items():
            given_values = {point.changes[key] for key in axis_keys(axis)}
            assert len(given_values) == 1
            assert given_values <= set(values)


def test_a_label_says_what_differs_in_few_words() -> None:
    grid = {"companion.methods": [["baseline"], ["baseline", "tangential"]], "links.swarm.loss": [0.1, 0.2]}
    labels = [point.label for point in points(sweep(grid=grid))]
    assert labels[:2] == ["methods=baseline loss=0.1", "methods=baseline loss=0.2"]
    assert labels[2] == "methods=baseline+tangential loss=0.1"
    two = sweep(grid={"links.swarm.loss": [0.1], "links.target.loss": [0.2]}, scenarios=["a", "b"])
    assert [point.label for point in points(two)] == [
        "a swarm.loss=0.1 target.loss=0.2",
        "b swarm.loss=0.1 target.loss=0.2",
    ]
    assert [point.label for point in points(sweep())] == ["antipodal-8"]


@given(DOCUMENTS, DOCUMENTS)
def test_what_was_laid_over_is_there_and_the_rest_is_as_before(
    document: dict[str, Any], changes: dict[str, Any]
) -> None:
    flat = leaves(changes)
    before = leaves(document)
    after = leaves(overlay(document, flat))
    assert flat.items() <= after.items()
    for key, value in before.items():
        if not any(f"{key}.".startswith(f"{new}.") or f"{new}.".startswith(f"{key}.") for new in flat):
            assert after[key] == value
    assert leaves(document) == before


# Cells


def test_a_cell_is_the_scenario_with_its_values_and_nothing_else() -> None:
    (cell,) = cells(sweep(grid={"links.swarm.loss + links.target.loss": [0.25], "vehicles": [4]}), "x")
    base = scenario("antipodal-8").model_dump()
    base["links"]["swarm"]["loss"] = base["links"]["target"]["loss"] = 0.25
    base["vehicles"] = 4
    assert scenario_of(task(cell, 9)).model_dump() == base


def test_a_key_is_of_what_is_flown_and_not_of_its_name() -> None:
    first = cells(sweep(grid={"vehicles": [4, 6]}), "x")
    second = cells(sweep(name="other", set={"vehicles": 6}), "y")
    assert first[0].key != first[1].key
    assert second[0].key == first[1].key


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"grid": {"vehicles": [4, 0]}}, "test.yaml: cell 'vehicles=0': vehicles is 0; allowed"),
        ({"grid": {"companion.methods": [["tangentail"]]}}, "did you mean 'tangential'?"),
        ({"grid": {"companion.metods": [["tangential"]]}}, "'metods' is unknown"),
        ({"grid": {"companion.metods": [["tangential"]]}}, "did you mean 'methods'?"),
        ({"grid": {"vehicles.x": [1]}}, "cell 'x=1': vehicles is a mapping"),
        ({"set": {"links.swarm.loss": 1.5}}, "links.swarm.loss is 1.5"),
        ({"set": {"vehicles": "8"}}, "remove the quotes"),
        ({"set": {"vehicle": "fireflie"}}, "did you mean 'firefly'?"),
        ({"set": {"companion.rates.replan_us": 10_004}}, "replan_us = 10004 is not a whole number of base"),
        (
            {"scenarios": ["antipodal-9"]},
            "cell 'antipodal-9': antipodal-9: neither a file nor a shipped name",
        ),
        ({"grid": {"vehicles": [8, 8]}}, "are the same; allowed: each once"),
    ],
)
def test_a_wrong_value_is_refused_and_its_cell_named(keys: dict[str, Any], said: str) -> None:
    assert said in refused(**keys)


def test_every_wrong_cell_is_named() -> None:
    lines = refused(grid={"vehicles": [0, 4, 500]}).split("\n")
    assert [line.split(": ")[1] for line in lines] == ["cell 'vehicles=0'", "cell 'vehicles=500'"]


def test_a_recorded_target_that_cannot_be_used_is_refused() -> None:
    assert "ends after" in refused(scenarios=["escort"], set={"target.duration_s": 3000.0})


@pytest.mark.parametrize("name", sorted(SCENARIOS))
def test_the_file_of_a_cell_is_exactly_its_scenario(name: str, tmp_path: Path) -> None:
    before = scenario(name)
    path = tmp_path / "cell.yaml"
    path.write_text(scenario_text(before), encoding="utf-8")
    assert load(path, Scenario) == before


@settings(max_examples=25)
@given(
    st.floats(0.0, 1.0),
    st.floats(1e-6, 1000.0),
    st.floats(-10_000.0, 10_000.0),
    st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=60),
)
def test_every_number_comes_back_to_the_last_bit(
    loss: float, radius: float, x: float, description: str
) -> None:
    before = scenario(
        "antipodal-8",
        links={"swarm": {"loss": loss}},
        starts={"radius": radius, "centre": [x, 0.0]},
        description=description,
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "cell.yaml"
        path.write_text(scenario_text(before), encoding="utf-8")
        assert load(path, Scenario) == before
