"""Missions: drawn ones keep their distance in the measure; files are read, or refused with the place."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.compare.comparison import Measure, Missions
from outrider.compare.json_places import place_of
from outrider.compare.measures import scaled
from outrider.compare.mission_files import folder_of, read
from outrider.compare.missions import drawn
from outrider.errors import InputError

BOX = Missions(low=(-1.5, -1.5, 0.5), high=(1.5, 1.5, 2.5), apart=0.32)
ELLIPSOID = Measure(kind="ellipsoid", least=0.3, downwash=2.0)


def least(places: np.ndarray) -> float:
    """Return the least distance of any two places in the measure."""
    first, second = np.triu_indices(len(places), 1)
    return float(scaled(places[first] - places[second], ELLIPSOID).min())


@pytest.mark.parametrize("seed", [1, 2])
def test_places_are_apart_in_the_measure_within_the_box_and_the_same_for_a_seed(seed: int) -> None:
    mission = drawn(BOX, ELLIPSOID, 40, seed)
    for places in mission:
        assert least(places) >= BOX.apart
        assert (places >= BOX.low).all()
        assert (places <= BOX.high).all()
    again = drawn(BOX, ELLIPSOID, 40, seed)
    assert all(map(np.array_equal, mission, again))
    assert not np.array_equal(mission.starts, drawn(BOX, ELLIPSOID, 40, seed + 2).starts)


def test_too_many_vehicles_are_refused() -> None:
    with pytest.raises(InputError, match=r"no room for 30 starts 0\.32 m apart in 0\.5 × 0\.5 × 0\.5 m"):
        drawn(Missions(low=(0.0, 0.0, 1.0), high=(0.5, 0.5, 1.5), apart=0.32), ELLIPSOID, 30, 1)


def written(folder: Path, name: str, text: str) -> Path:
    """Write a mission file."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_files_are_read_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for number in (10, 2, 1):
        agents = [{"type": "crazyflie", "cid": 1, "start": [number, 0, 1], "goal": [0, 1, 1.5]}]
        written(
            tmp_path, f"multi_{number}.json", json.dumps({"world": [], "agents": agents, "obstacles": []})
        )
    assert [one.starts[0, 0] for one in folder_of(tmp_path, 1, ELLIPSOID)] == [1.0, 2.0, 10.0]
    with pytest.raises(InputError, match="none has 2 vehicles"):
        folder_of(tmp_path, 2, ELLIPSOID)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ('{"agents": [', r":1:13: no JSON"),
        ("\n {}", ":2:2: agents: Field required"),
        ('{"agents": []}', ":1:12: agents: "),
        ('{"agents":\n [{"start": [0, 0], "goal": [0, 0, 1]}]}', r":2:13: agents\.0\.start"),
        ('{"agents": [{"start": [0,\n 0,\n  NaN], "goal": [0, 0, 1]}]}', r":3:3: agents\.0\.start\.2"),
        ('{"agents": [{"goal": [0, 0, 1]}]}', r":1:13: agents\.0\.start: Field required"),
    ],
)
def test_a_faulty_file_is_refused_with_its_place(tmp_path: Path, text: str, what: str) -> None:
    path = written(tmp_path, "mission.json", text)
    with pytest.raises(InputError, match=what):
        read(path, ELLIPSOID)


@given(
    st.text(max_size=200) | st.recursive(st.none() | st.floats() | st.text(max_size=5), st.lists).map(repr)
)
def test_any_text_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.getbasetemp() / "any.json"
    path.write_text(text, encoding="utf-8", errors="replace")
    try:
        mission = read(path, ELLIPSOID)
    except InputError:
        return
    assert np.isfinite(mission.starts).all()


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=20,
)


@given(values, st.sampled_from([None, 0, 1, 3]), st.data())
def test_the_place_of_a_value_is_where_its_text_begins(
    value: object, indent: int | None, data: st.DataObject
) -> None:
    text = json.dumps(value, indent=indent)
    path: list[int | str] = []
    while isinstance(value, list | dict) and value and data.draw(st.booleans()):
        step = data.draw(st.sampled_from(list(value) if isinstance(value, dict) else range(len(value))))
        path.append(step)
        value = value[step]
    line, column = place_of(text, path)
    rest = "\n".join(text.split("\n")[line - 1 :])[column - 1 :]
    found = json.JSONDecoder().raw_decode(rest)[0]
    assert json.dumps(found) == json.dumps(value)
    # What is missing has the place of what it is missing in.
    assert place_of(text, [*path, -1]) == (line, column)
