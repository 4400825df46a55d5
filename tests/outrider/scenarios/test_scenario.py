"""What a scenario is: every shipped file loads, contradictions are refused, and nothing that loads breaks
later."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from companion.config import CompanionConfig
from outrider.errors import InputError
from outrider.scenarios.scenario import FIRST_SYSTEM, TARGET_SYSTEM, Points, RecordedTarget, Scenario
from outrider.scenarios.starts import starts
from outrider.simulation.flight import EPOCH, Flight
from outrider.yaml_files.yaml_file import load, read
from tests.outrider.shipped import FIREFLY, LOGS, SCENARIOS, scenario

NAMES = sorted(SCENARIOS)
TEXTS = {name: path.read_text() for name, path in SCENARIOS.items()}


def test_the_promised_scenarios_are_there() -> None:
    assert {"antipodal-8", "escort", "scenario-1"} <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_file_is_named_after_its_scenario_and_can_be_flown(name: str) -> None:
    shipped = load(SCENARIOS[name], Scenario)
    assert shipped.name == name
    assert shipped.description
    flight = Flight(shipped, FIREFLY, 1, LOGS)
    assert len(flight.autopilots) == len(flight.companions) == shipped.size
    assert flight.systems[0] == FIRST_SYSTEM


@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_survives_json(name: str) -> None:
    shipped = load(SCENARIOS[name], Scenario)
    assert Scenario.model_validate_json(shipped.model_dump_json(), strict=True) == shipped


@pytest.mark.parametrize("name", NAMES)
def test_vehicles_start_farther_apart_than_d_min_and_inside_the_box(name: str) -> None:
    shipped = load(SCENARIOS[name], Scenario)
    limits, jitter = shipped.companion.limits, shipped.starts.jitter
    still = tuple(other.model_copy(update={"jitter": 0.0}) for other in shipped.bystanders)
    exact = shipped.model_copy(
        update={"starts": shipped.starts.model_copy(update={"jitter": 0.0}), "bystanders": still}
    )
    places = starts(exact, 1, False).positions
    moved = np.array([jitter] * shipped.vehicles + [other.jitter for other in shipped.bystanders])
    i, j = np.triu_indices(len(places), 1)
    apart = np.linalg.norm(places[i] - places[j], axis=1) - moved[i] - moved[j]
    assert apart.min() > 2.0 * shipped.d_min
    assert (places - jitter > limits.box_min).all()
    assert (places + jitter < limits.box_max).all()


CONTRADICTIONS: list[tuple[str, dict[str, Any], str]] = [
    ("antipodal-8", {"timing": {"base_tick_us": 4_000}}, "not a whole number of base ticks"),
    ("antipodal-8", {"timing": {"base_tick_us": 2_502}}, "multiple of 4"),
    ("antipodal-8", {"timing": {"base_tick_us": 1_100, "companion_us": 11_000}}, "does not divide a second"),
    ("antipodal-8", {"companion": {"rates": {"replan_us": 11_000}}}, "not a whole number of base ticks"),
    ("antipodal-8", {"companion": {"rates": {"setpoint_us": 12_004}}}, "not a whole number of base ticks"),
    ("antipodal-8", {"companion": {"rates": {"replan_us": 5_000}}}, "at least timing.companion_us"),
    (
        "antipodal-8",
        {"target": {"kind": "recorded", "log": "x.tlog", "system": 1, "start_s": 0.0, "duration_s": 5.0}},
        "needs a target of kind 'fixed'",
    ),
    ("escort", {"target": {"system": 12}}, "id of a vehicle"),
    ("escort", {"companion": {"task": "goto"}}, "task 'escort' needs companion.task: escort; it is 'goto'"),
    ("escort", {"companion": {"target_d_safe": None}}, "come together"),
    ("escort", {"companion": {"limits": {"a_total": 1.0}}}, "a_total"),
    ("scenario-1", {"vehicles": 0}, "greater than or equal to 1"),
    ("scenario-1", {"vehicles": 245}, "less than or equal to 244"),
    ("scenario-1", {"target": {"at": [1e9, 0.0, 0.0]}}, "less than or equal to 10000"),
    ("scenario-1", {"starts": {"centre": [0.0, -1e9]}}, "greater than or equal to -10000"),
    ("scenario-1", {"starts": {"radius": float("nan")}}, "finite"),
    ("scenario-1", {"links": {"swarm": {"loss": 1.1}}}, "less than or equal to 1"),
    ("scenario-1", {"links": {"swarms": {}}}, "not permitted"),
]


@pytest.mark.parametrize(("name", "changes", "said"), CONTRADICTIONS)
def test_what_cannot_be_is_refused(name: str, changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        scenario(name, **changes)


@pytest.mark.parametrize("name", NAMES)
def test_nothing_changes_after_load(name: str) -> None:
    shipped = load(SCENARIOS[name], Scenario)
    with pytest.raises(ValidationError, match="frozen"):
        shipped.vehicles = 3
    with pytest.raises(ValidationError, match="frozen"):
        shipped.companion.limits.a_total = 30.0


def test_only_a_goal_event_makes_a_time_of_convergence() -> None:
    assert scenario("antipodal-8").has_goal
    assert scenario("scenario-1").has_goal
    assert not scenario("scenario-1", target={"jump_to": None}).has_goal
    assert not scenario("escort").has_goal


def test_a_recording_is_flown_as_long_as_it_lasts() -> None:
    escort = scenario("escort", cap_s=3.0)
    assert isinstance(escort.target, RecordedTarget)
    assert escort.duration_s == escort.target.duration_s
    assert scenario("scenario-1", cap_s=3.0).duration_s == 3.0


def test_no_vehicle_can_have_the_target_s_system_id() -> None:
    assert not FIRST_SYSTEM <= TARGET_SYSTEM < FIRST_SYSTEM + 244
    assert FIRST_SYSTEM + 243 < 255


def test_flights_begin_on_a_tick_whatever_the_tick() -> None:
    assert EPOCH % 1_000_000 == 0


def test_the_defaults_of_a_companion_fit_the_defaults_of_a_scenario() -> None:
    assert scenario("scenario-1", companion=CompanionConfig().model_dump()).companion == CompanionConfig()


# Hypothesis: shipped files gone wrong

NASTY = (
    st.none()
    | st.booleans()
    | st.integers(-(1 << 70), 1 << 70)
    | st.integers(-3, 300)
    | st.floats()
    | st.floats(-10.0, 10.0)
    | st.sampled_from(["", "fixed", "recorded", "tangential", "px4", "10", ".nan", "\0", "ﬁxed", "/", "../x"])
    | st.text(max_size=5)
)
VALUES = NASTY | st.lists(NASTY, max_size=4) | st.dictionaries(st.text(max_size=4), NASTY, max_size=2)


def paths(tree: Any, here: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Every place in a document."""
    inner: list[tuple[str | int, Any]] = []
    if isinstance(tree, dict):
        inner = list(tree.items())
    elif isinstance(tree, list):
        inner = list(enumerate(tree))
    return [here, *(path for key, value in inner for path in paths(value, (*here, key)))]


def full(name: str) -> dict[str, Any]:
    """The file with all defaults written out, so that every key there is can go wrong."""
    document = load(SCENARIOS[name], Scenario).model_dump(mode="json")
    assert isinstance(document, dict)
    return document


FULL = {name: full(name) for name in NAMES}


@st.composite
def spoilt(draw: st.DrawFn) -> bytes:
    """A shipped scenario with one to three values replaced, removed or added."""
    document: Any = yaml.safe_load(yaml.safe_dump(FULL[draw(st.sampled_from(NAMES))]))
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from(paths(document)[1:] or [("name",)]))
        inner = document
        for key in path[:-1]:
            inner = inner[key]
        change = draw(st.sampled_from(["replace", "replace", "remove", "add"]))
        if change == "replace":
            inner[path[-1]] = draw(VALUES)
        elif change == "remove":
            del inner[path[-1]]
        elif isinstance(inner, dict):
            inner[draw(st.text(min_size=1, max_size=6))] = draw(VALUES)
    return yaml.safe_dump(document, allow_unicode=True).encode(errors="surrogatepass")


def check(data: bytes) -> None:
    """It is refused line by line, or a flight can be made of it."""
    refusal = InputError("")
    try:
        loaded = read(data, "spoilt.yaml", Scenario)
        # Two vehicles are enough, and quicker; places that are given one by one are as many as the vehicles.
        few = loaded.vehicles if isinstance(loaded.starts, Points) else min(loaded.vehicles, 2)
        Flight(loaded.model_copy(update={"vehicles": few}), FIREFLY, 1, LOGS)
    except InputError as error:
        refusal = error
    lines = str(refusal).split("\n")
    assert len(lines) == len(refusal.faults)
    assert all(line.isprintable() for line in lines)


@settings(deadline=None, max_examples=60)
@given(spoilt())
def test_a_spoilt_value_is_refused_or_harmless(data: bytes) -> None:
    check(data)


@settings(deadline=None, max_examples=60)
@given(
    st.sampled_from(NAMES),
    st.lists(
        st.tuples(
            st.integers(0, 2_000),
            st.integers(0, 8),
            st.sampled_from([*"[]{}:,#'\"|>-&*!\n\t 0", "\n  ", "1e400", "~", ".inf", "- ", "é"]),
        ),
        min_size=1,
        max_size=4,
    ),
)
def test_a_spoilt_text_is_refused_or_harmless(name: str, edits: list[tuple[int, int, str]]) -> None:
    document = TEXTS[name]
    for at, length, put in edits:
        at %= len(document) + 1
        document = document[:at] + put + document[at + length :]
    check(document.encode())


@pytest.mark.parametrize("name", NAMES)
def test_a_file_that_breaks_off_is_refused_or_whole(name: str) -> None:
    for length in range(0, len(TEXTS[name]), 41):
        check(TEXTS[name][:length].encode())
