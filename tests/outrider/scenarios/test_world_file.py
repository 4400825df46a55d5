"""World files: what is written is read again, and whatever is wrong is named with its line and column."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from companion.config.obstacles import MOST_OBSTACLES, Box, Post, Wall
from outrider.errors import InputError
from outrider.resources import config_root
from outrider.runs.configuration import configured, write_fly_config, write_scenario
from outrider.scenarios.fly_config import FlyConfig
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.world_file import beside, boxes_of, with_world, write_world
from outrider.yaml_files.yaml_file import load

places, sizes, angles = st.floats(-1e4, 1e4), st.floats(0.0, 1e3, exclude_min=True), st.floats(-360.0, 360.0)
boxes = st.builds(
    lambda at, size, yaw: Box(kind="box", at=at, size=size, yaw_deg=yaw),
    st.tuples(places, places, places),
    st.tuples(sizes, sizes, sizes),
    angles,
)
BOXES = config_root() / "scenarios" / "boxes.yaml"
GOOD = "1,2,3,4,5,6\n"


def box(*numbers: float) -> Box:
    return Box(kind="box", at=numbers[:3], size=numbers[3:6], yaw_deg=[*numbers, 0.0][6])


def wrong(text: str | bytes) -> str:
    with pytest.raises(InputError) as caught:
        boxes_of(text if isinstance(text, bytes) else text.encode(), "w.csv")
    return str(caught.value)


@given(st.lists(boxes, max_size=5))
def test_what_is_written_is_read_to_the_last_bit(tmp_path_factory, found):
    path = tmp_path_factory.mktemp("world") / "w.csv"
    write_world(path, found)
    assert with_world((), "w.csv", path.parent) == tuple(found)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    "head", ["", "x,y,z,sx,sy,sz\n", "\ufeffX, Y, Z, SX, SY, SZ, YAW_DEG\n", "# room\n\n"]
)
def test_with_and_without_a_header_and_with_and_without_an_angle(head, end):
    text = (head + GOOD + "\n -1.5 , 0,.5,1e-1,2,3,-30\n# end").replace("\n", end)
    assert boxes_of(text.encode(), "w.csv") == (box(1, 2, 3, 4, 5, 6), box(-1.5, 0, 0.5, 0.1, 2, 3, -30))


@pytest.mark.parametrize("cell", ["nan", "-inf", "1e999", "-1", "0", "1000.1", "abc", "", "1_0", "0x1", "١x"])
@pytest.mark.parametrize("column", [0, 4])
def test_a_wrong_number_is_named_with_line_and_column_and_what_is_allowed(cell, column):
    if column == 0 and cell in ("-1", "0", "1000.1"):
        return
    cells = ["1", "2", "3", "4", "5", "6"]
    cells[column] = " " + cell
    said = wrong(GOOD + "\n" + ",".join(cells))
    name, allowed = ("x", "-10000 to 10000") if column == 0 else ("sy", "more than 0 to 1000")
    assert said.startswith(f"w.csv:3:{2 * column + 2}: {name} is ")
    assert said.endswith(f"allowed: {allowed}")


@pytest.mark.parametrize(
    ("row", "column"), [("1,2,3,4,5", 9), ("1", 1), ("1,2,3,4,5,6,7,8", 15), ("1;2;3", 1)]
)
def test_a_wrong_number_of_columns_is_named(row, column):
    said = wrong(GOOD + row)
    assert said.startswith(f"w.csv:2:{column}: ")
    assert "columns; allowed: 6 or 7, x,y,z,sx,sy,sz[,yaw_deg]" in said


def test_a_header_of_other_names_is_named_and_one_further_down_is_no_row():
    said = wrong("x,y,z,w,h,d\n" + GOOD)
    assert said.startswith("w.csv:1:7: the header is x,y,z,w,h,d; allowed: x,y,z,sx,sy,sz or ")
    assert wrong(GOOD + "x,y,z,sx,sy,sz\n").startswith("w.csv:2:1: x is 'x', no number")


def test_all_faults_are_named_up_to_a_number_and_a_size_is_not_exceeded():
    assert [line[:8] for line in wrong("1,2,3,0,5,nan\n" + GOOD + "q").splitlines()] == [
        "w.csv:1:",
        "w.csv:1:",
        "w.csv:3:",
    ]
    assert wrong("q,1\n" * 500).splitlines()[-1] == "w.csv: and more faults"
    assert "allowed" in wrong(GOOD * (MOST_OBSTACLES + 1))
    assert "most allowed" in wrong(b" " * (5 << 20))
    assert wrong(b"1,2\n3,\xff").startswith("w.csv:2:3: byte 0xff is not UTF-8")


@given(st.binary(max_size=200) | st.text("0123456789.,-+e \nxyzsnaif#\r\t\x00", max_size=200).map(str.encode))
@example(b"\x00")
@example(b"9" * 5000)
@example(b"\xef\xbb\xbf")
def test_any_bytes_are_boxes_or_an_error_with_places(data):
    try:
        found = boxes_of(data, "w.csv")
    except InputError as error:
        for line in str(error).splitlines():
            assert line.startswith("w.csv")
            assert "allowed" in line or "more faults" in line
    else:
        assert all(min(one.size) > 0.0 for one in found)


def test_a_scenario_and_a_companion_have_the_boxes_of_the_file_beside_them(tmp_path: Path):
    (tmp_path / "w.csv").write_text(GOOD)
    scenario = BOXES.read_text()
    (tmp_path / "s.yaml").write_text(scenario + "world: w.csv\n")
    found, plain = load(tmp_path / "s.yaml", Scenario), load(BOXES, Scenario)
    assert found.obstacles == (*plain.obstacles, box(1, 2, 3, 4, 5, 6))
    assert found.world is None
    (tmp_path / "c.yaml").write_text(
        "target: 9\norigin: {latitude: 47.0, longitude: 8.0, altitude: 0.0}\nworld: w.csv\n"
    )
    assert load(tmp_path / "c.yaml", FlyConfig).companion.obstacles == (box(1, 2, 3, 4, 5, 6),)
    (tmp_path / "w.csv").unlink()
    with pytest.raises(InputError, match=r"w\.csv: cannot be read: No such file"):
        load(tmp_path / "s.yaml", Scenario)


def test_a_long_list_that_ends_with_boxes_gets_a_file_and_comes_back_in_order(tmp_path: Path):
    post = Post(kind="post", at=(0.0, 1.0), radius=0.5)
    wall = Wall(kind="wall", ends=((0.0, 0.0), (1.0, 2.0)))
    many = (box(1, 2, 3, 4, 5, 6), post, wall, *(box(k, 2, 3, 4, 5, 6, 7) for k in range(150)))
    stated, name = beside(many, tmp_path)
    assert stated == many[:3]
    assert with_world(stated, name, tmp_path) == many
    assert beside(many[:20], tmp_path) == (many[:20], None)


@pytest.mark.parametrize("count", [3, 150])
def test_a_run_directory_has_all_boxes_wherever_it_is_moved(tmp_path: Path, count: int):
    added = tuple(box(k, 2, 3, 4, 5, 6, 7) for k in range(count))
    scenario = load(BOXES, Scenario)
    scenario = scenario.model_copy(update={"obstacles": (*scenario.obstacles, *added)})
    (tmp_path / "run").mkdir()
    write_scenario(tmp_path / "run", 5, scenario)
    moved = (tmp_path / "run").rename(tmp_path / "moved")
    assert configured(moved, "allowed: a run", None).scenario == scenario
    (tmp_path / "c.yaml").write_text("target: 9\norigin: {latitude: 47.0, longitude: 8.0, altitude: 0.0}\n")
    config = load(tmp_path / "c.yaml", FlyConfig)
    companion = config.companion.model_copy(update={"obstacles": added})
    config = config.model_copy(update={"companion": companion})
    (tmp_path / "fly").mkdir()
    write_fly_config(tmp_path / "fly", config)
    assert load(tmp_path / "fly" / "configuration.yaml", FlyConfig) == config
