"""What the options of ``outrider swarm`` change in a scenario, and where a run is put."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.errors import InputError
from outrider.scenarios.options import METHODS, Options, apply
from outrider.scenarios.scenario import Scenario
from outrider.simulation.preparation import prepare
from outrider.swarm.command import run_directory
from tests.outrider.shipped import FIREFLY, SCENARIOS, scenario

BASE = scenario("antipodal-8")


def changed(before: Any, after: Any, path: str = "") -> set[str]:
    """Names of all values that differ."""
    if isinstance(before, dict) and isinstance(after, dict) and set(before) == set(after):
        names: set[str] = set()
        for key in before:
            names |= changed(before[key], after[key], f"{path}.{key}".removeprefix("."))
        return names
    return {path} if before != after else set()


@pytest.mark.parametrize("name", sorted(SCENARIOS))
def test_without_options_the_file_is_flown_as_it_is(name: str) -> None:
    prepared = prepare(name, Options())
    assert prepared.scenario == scenario(name)
    assert prepared.vehicle == FIREFLY


@pytest.mark.parametrize(
    ("options", "values"),
    [
        (Options(method="baseline"), {"companion.methods": ("baseline",)}),
        (Options(method="baseline+tangential"), {"companion.methods": ("baseline", "tangential")}),
        (Options(avoidance="field"), {}),
        (Options(planar=True), {"companion.planar": True}),
        (Options(planar=False), {}),
        (Options(vehicles=3), {"vehicles": 3}),
        (Options(loss=0.25), {"links.swarm.loss": 0.25, "links.target.loss": 0.25}),
        (Options(loss=0.0), {}),
        (Options(delay_ms=55.0), {"links.swarm.delay_ms": 55.0, "links.target.delay_ms": 55.0}),
        (Options(sensors="truth"), {}),
        (Options(replan_hz=20.0), {"companion.rates.replan_us": 50_000}),
        (
            Options(vehicles=2, replan_hz=50.0, loss=0.1),
            {
                "vehicles": 2,
                "companion.rates.replan_us": 20_000,
                "links.swarm.loss": 0.1,
                "links.target.loss": 0.1,
            },
        ),
    ],
)
def test_an_option_changes_what_it_names_and_nothing_else(options: Options, values: dict[str, Any]) -> None:
    after = apply(BASE, options)
    before, document = BASE.model_dump(), after.model_dump()
    assert changed(before, document) == set(values)
    for path, value in values.items():
        found: Any = document
        for key in path.split("."):
            found = found[key]
        assert found == value


def test_options_leave_the_scenario_that_was_given_alone() -> None:
    before = BASE.model_dump()
    apply(BASE, Options("baseline", "field", True, 3, 0.5, 100.0, "truth", 20.0))
    assert BASE.model_dump() == before


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            Options(method="tangentail"),
            "'tangentail' is no method; allowed are baseline, swivel, approach_angle, tangential",
        ),
        (Options(method=""), "is no method"),
        (Options(method="tangential+"), "is no method"),
        (Options(method="tangential+tangential"), "twice"),
        (Options(avoidance="certifed"), "--avoidance"),
        (Options(vehicles=0), "--vehicles"),
        (Options(vehicles=-3), "--vehicles"),
        (Options(vehicles=1000), "--vehicles"),
        (Options(loss=1.5), "--loss"),
        (Options(loss=float("nan")), "--loss"),
        (Options(delay_ms=-1.0), "--delay-ms"),
        (Options(delay_ms=float("inf")), "--delay-ms"),
        (Options(sensors="gps"), "--sensors"),
        (Options(replan_hz=0.0), "--replan-hz"),
        (Options(replan_hz=-20.0), "--replan-hz"),
        (Options(replan_hz=float("nan")), "--replan-hz"),
        (Options(replan_hz=float("inf")), "--replan-hz"),
        (Options(replan_hz=30.0), "--replan-hz 30: a plan's period"),
        (Options(replan_hz=33.0), "nearest allowed: 33.333"),
        (Options(wind="nan"), "--wind nan: allowed is a speed in m/s"),
        (Options(wind="1,inf"), "--wind 1,inf: "),
        (Options(wind="100"), "each from -50 to 50"),
        (Options(replan_hz=1e-9), "--replan-hz"),
        (Options(replan_hz=400.0), "nearest allowed: 100"),
    ],
)
def test_a_bad_option_is_one_line(options: Options, said: str) -> None:
    with pytest.raises(InputError) as caught:
        apply(BASE, options)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "allowed" in str(caught.value) or "twice" in str(caught.value)
    assert not any(word in str(caught.value) for word in ("Input should", "Value error", "options:"))


def test_places_are_not_made_up_for_more_vehicles() -> None:
    points = {"kind": "points", "at": [[0.0, 0.0, 5.0], [9.0, 0.0, 5.0]], "goals": None}
    of = scenario("scenario-1", vehicles=2, starts=points)
    assert apply(of, Options(vehicles=2)) == of
    with pytest.raises(InputError, match=r"--vehicles 3: .* 2 places; allowed: 2"):
        apply(of, Options(vehicles=3))


def test_a_rule_that_options_break_names_them() -> None:
    of = scenario("antipodal-8", faults=[{"kind": "vanish", "vehicle": 18, "at_s": 1.0}])
    with pytest.raises(InputError, match=r"^--vehicles 3: faults\[0\].vehicle = 18 is none of the fleet"):
        apply(of, Options(vehicles=3))


@given(st.floats(0.1, 1000.0))
@settings(deadline=None, max_examples=60)
def test_the_nearest_rate_is_allowed_and_none_is_nearer(rate: float) -> None:
    tick, least = BASE.timing.base_tick_us, BASE.timing.companion_us
    try:
        assert apply(BASE, Options(replan_hz=rate)).companion.rates.replan_us % tick == 0
    except InputError as error:
        near = float(str(error).rpartition(" ")[2])
        period = apply(BASE, Options(replan_hz=near)).companion.rates.replan_us
        others = range(least, 10_000_001, tick)
        assert abs(1e6 / period - rate) == pytest.approx(min(abs(1e6 / one - rate) for one in others))


def test_a_rotor_that_is_not_there_is_refused_before_anything_is_flown(tmp_path: Path) -> None:
    document = scenario("antipodal-8").model_dump(mode="json")
    document["faults"] = [
        {"kind": "motor", "vehicle": 11, "at_s": 1.0, "rotor": rotor, "left": 0.0} for rotor in (5, 6, 12)
    ]
    file = tmp_path / "motors.yaml"
    file.write_text(json.dumps(document))
    with pytest.raises(InputError) as caught:
        prepare(str(file), Options())
    assert str(caught.value).split("\n") == [
        f"{file}: faults[{index}].rotor is {rotor}; firefly has rotors 0 to 5"
        for index, rotor in ((1, 6), (2, 12))
    ]


def test_several_faults_are_a_line_each() -> None:
    with pytest.raises(InputError) as caught:
        apply(BASE, Options(vehicles=0, loss=1.5, sensors="gps"))
    lines = str(caught.value).split("\n")
    assert sorted(line.split()[0] for line in lines) == ["--loss", "--sensors", "--vehicles"]


NUMBERS = st.none() | st.floats() | st.floats(0.0, 1.0) | st.sampled_from([10.0, 20.0, 50.0, 100.0])
OPTIONS = st.builds(
    Options,
    method=st.none() | st.sampled_from([*METHODS, "+".join(METHODS)]) | st.text(max_size=8),
    avoidance=st.none() | st.just("field") | st.text(max_size=4),
    planar=st.booleans(),
    vehicles=st.none() | st.integers() | st.integers(1, 20),
    loss=NUMBERS,
    delay_ms=NUMBERS,
    sensors=st.none() | st.just("truth") | st.text(max_size=4),
    replan_hz=NUMBERS,
)


@settings(deadline=None, max_examples=200)
@given(OPTIONS)
def test_any_options_are_a_scenario_or_an_input_error(options: Options) -> None:
    try:
        after = apply(BASE, options)
    except InputError:
        return
    assert isinstance(after, Scenario)
    assert Scenario.model_validate(after.model_dump()) == after


# Where a run is put


def test_a_run_s_directory_is_named_after_it_and_never_used_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    made = [run_directory(None, BASE, 7) for _ in range(3)]
    assert [path.as_posix() for path in made] == [
        "runs/antipodal-8-tangential-seed7",
        "runs/antipodal-8-tangential-seed7-2",
        "runs/antipodal-8-tangential-seed7-3",
    ]
    assert all(path.is_dir() for path in made)
    other = run_directory(None, apply(BASE, Options(method="baseline+tangential")), 8)
    assert other.name == "antipodal-8-baseline+tangential-seed8"


def test_runs_that_start_at_once_never_share_a_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda _: run_directory(None, BASE, 1), range(24)))
    assert len(set(made)) == 24


def test_a_file_of_that_name_is_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "antipodal-8-tangential-seed1").write_text("mine")
    assert run_directory(None, BASE, 1).name == "antipodal-8-tangential-seed1-2"


@pytest.mark.parametrize("there", ["nothing", "empty"])
def test_out_may_be_new_or_empty(there: str, tmp_path: Path) -> None:
    out = tmp_path / "deep" / "run"
    if there == "empty":
        out.mkdir(parents=True)
    assert run_directory(out, BASE, 1) == out
    assert out.is_dir()


def test_out_that_holds_something_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    for out in (tmp_path, tmp_path / "notes.txt", tmp_path / "notes.txt" / "run"):
        with pytest.raises(InputError) as caught:
            run_directory(out, BASE, 1)
        assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    assert (tmp_path / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("kind", ["file", "dangling"])
def test_runs_that_cannot_be_a_folder_is_refused(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if kind == "file":
        (tmp_path / "runs").touch()
    else:
        (tmp_path / "runs").symlink_to(tmp_path / "nowhere" / "deep")
    with pytest.raises(InputError, match="runs: cannot be made"):
        run_directory(None, BASE, 1)
