"""``outrider gallery`` as a whole, with flights that take no time, and what its panels fly."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from outrider.errors import InputError
from outrider.gallery import figures
from outrider.gallery.command import gallery
from outrider.gallery.figures import outcome
from outrider.gallery.flying import fly
from outrider.gallery.page import page
from outrider.gallery.showings import WAYS, cells_of, chosen, scenarios, showings
from outrider.resources import config_root
from outrider.sweep.cells import scenario_of, task
from outrider.sweep.runs import Ending, Run, run_of
from outrider.sweep.tasks import Entry
from tests.outrider.saved_figures import saved_figures


@pytest.mark.slow
def test_every_scenario_is_flown_in_every_way() -> None:
    assert set(scenarios()) == {path.stem for path in (config_root() / "scenarios").iterdir()}
    shown = showings(chosen(()))
    cells = cells_of(shown)
    assert len({cell.key for cell in cells}) == len(cells) == len(WAYS) * len(scenarios())
    for (scenario, way), cell in zip(shown, cells, strict=True):
        flown = scenario_of(task(cell, 1))
        assert flown.name == scenario
        assert flown.airborne
        certified = flown.companion.avoidance == "certified"
        assert certified if way == "certified" else flown.companion.methods == (way,) and not certified


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_the_page_shows_all_and_says_what_became_of_each(here: Path) -> None:
    assert gallery(("traffic", "obstacles"), to=Path("page"), run="tests.outrider.gallery.runs:straight") == 1
    text = (here / "page" / "README.md").read_text()
    row = "| [traffic](#traffic) | stuck, least 1.50 m | no flight: "
    assert row in text
    assert "| 7.2 s, least 1.50 m | 7.2 s, least 1.50 m | 7.2 s, least 0.40 m, 1 violation |" in text
    assert "Four vehicles change lanes between posts and spheres." in text
    for name in ("traffic", "obstacles"):
        assert f"[![{name}]({name}.png)]({name}.png)" in text
        assert (here / "page" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert (here / "runs" / "sweep-gallery" / "journal.jsonl").is_file()


@pytest.mark.slow
def test_what_is_flown_already_is_not_flown_again(here: Path) -> None:
    assert gallery(("obstacles",), out=Path("out"), run="tests.outrider.gallery.runs:fine") == 0
    before = Path("out/journal.jsonl").read_bytes()
    assert gallery(("obstacles",), out=Path("out"), run="tests.outrider.gallery.runs:never") == 0
    assert Path("out/journal.jsonl").read_bytes() == before


@pytest.mark.slow
def test_a_few_may_be_flown_before_the_rest(here: Path) -> None:
    assert gallery(("obstacles",), out=Path("out"), run="tests.outrider.gallery.runs:fine") == 0
    assert gallery(("traffic", "obstacles"), out=Path("out"), run="tests.outrider.gallery.runs:fine") == 0
    assert "## traffic" in (here / "out" / "README.md").read_text()


def test_a_page_of_somebody_else_is_not_overwritten(here: Path) -> None:
    (here / "README.md").write_text("# Mine\n")
    with pytest.raises(InputError, match=r"holds a README\.md that is no gallery"):
        gallery(("obstacles",), to=here, run="tests.outrider.gallery.runs:fine")
    (here / "file").touch()
    with pytest.raises(InputError, match="--page file: cannot be made"):
        gallery(("obstacles",), to=Path("file"), run="tests.outrider.gallery.runs:fine")
    assert (here / "README.md").read_text() == "# Mine\n"
    assert not list(here.glob("**/*.png"))


def test_what_is_said_of_a_failure_is_short_and_no_table() -> None:
    nothing = (None,) * 4
    run = Run(1, Ending.FAULT, *nothing, 0, *nothing, "unsupported operand | " + 80 * "long ")
    assert outcome(run).startswith("no flight: unsupported operand")
    assert len(outcome(run)) < 60
    text = page({"traffic": [(way, run, None) for way in WAYS]}, {"traffic": "x"}, 1)
    (row,) = [line for line in text.splitlines() if line.startswith("| [traffic]")]
    assert row.count("|") == len(WAYS) + 2


def test_a_scenario_that_is_not_shipped_is_refused_with_those_that_are(here: Path) -> None:
    with pytest.raises(InputError, match="'nowhere' is not shipped; allowed: adversary, antipodal"):
        gallery(("nowhere",))
    assert list(here.iterdir()) == []


def test_a_scene_has_what_the_picture_needs() -> None:
    (cell,) = (one for one in cells_of(showings(("scenario-3",))) if one.label.endswith("tangential"))
    document = json.loads(cell.document)
    document["companion"]["rates"]["replan_us"] = 50_000
    cell = cell._replace(document=json.dumps(document))
    summary = fly(task(cell, 1))
    scene = summary["scene"]
    assert summary["converged"] is True
    count = len(scene["time_s"])
    assert len(scene["position"]) == len(scene["separation"]) == len(scene["target"]) == count
    assert scene["time_s"][0] == 0.0
    assert scene["time_s"][-1] > summary["convergence_time_s"]
    flown = scenario_of(task(cell, 1))
    assert len(scene["position"][0]) == flown.size
    assert scene["vehicles"] == flown.vehicles == 1
    assert abs(min(scene["separation"]) - summary["min_separation_m"]) < 0.01


@pytest.mark.parametrize(("separation", "whose"), [(0.4, ""), (0.6, " (target or obstacle)")])
def test_whose_violation_it_was(separation: float, whose: str) -> None:
    summary = {"converged": True, "convergence_time_s": 7.0, "min_separation_m": separation, "d_min_m": 0.5}
    run = run_of(Entry("key", 1, "done", None, summary | {"d_min_violations": 1}, 0.0))
    assert outcome(run) == f"7.0 s, least {separation:.2f} m, 1 violation{whose}"


def scene(shift: float, *, apart: float, standoff: bool) -> dict[str, Any]:
    """What a flight leaves for its panel: two vehicles that fly north, ``shift`` to the east."""
    times = [0.1 * k for k in range(20)]
    found: dict[str, Any] = {
        "time_s": times,
        "position": [[[shift, 10.0 * t], [shift + 3.0, 10.0 * t]] for t in times],
        "separation": [apart] * 20,
        "target": [[shift, 5.0]] * 20,
        "obstacles": [[shift + 8.0, 0.0, 1.0]],
        "moving": [],
        "moving_radius": [],
        "vehicles": 2,
        "d_min": 0.5,
    }
    return found | ({"standoff": [[0.3, 0.9]] * 20} if standoff else {})


@pytest.fixture
def drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Figure]:
    """Draws panels, and gives the figure."""
    kept = saved_figures(monkeypatch)

    def call(*scenes: dict[str, Any] | None) -> Figure:
        run = run_of(Entry("key", 1, "done", None, {"converged": True, "convergence_time_s": 1.0}, 0.0))
        figures.draw(
            "a scenario", [(way, run, of) for way, of in zip(WAYS, scenes, strict=False)], tmp_path / "a.png"
        )
        return kept[-1]

    return call


def test_panels_of_a_row_have_the_same_axes_and_no_chart_is_empty(drawn: Callable[..., Figure]) -> None:
    figure = drawn(
        scene(0.0, apart=3.0, standoff=True),
        scene(40.0, apart=30.0, standoff=True),
        scene(5.0, apart=-1.0, standoff=True),
    )
    rows = np.array(figure.axes).reshape(3, 3)
    for row in rows:
        assert len({(axes.get_xlim(), axes.get_ylim()) for axes in row}) == 1
    for axes in rows[1:].ravel():
        low, high = axes.get_ylim()
        there = [y for line in axes.lines for y in np.ravel(line.get_ydata()) if len(line.get_ydata()) > 2]
        assert axes.texts or any(low <= y <= high for y in there)
    assert [axes.get_ylabel() for axes in rows[:, 0]] == [
        "north, m",
        "least separation, m",
        "stand-off error, m",
    ]
    # The separation of 30 m lies in its chart, as everything in the picture from above does.
    assert rows[1, 1].get_ylim()[1] > 30.0
    assert rows[0, 0].get_xlim()[0] < 0.0 < 49.0 < rows[0, 0].get_xlim()[1]


def test_without_an_escort_there_is_no_stand_off_and_without_a_flight_no_axes(
    drawn: Callable[..., Figure],
) -> None:
    figure = drawn(scene(0.0, apart=3.0, standoff=False), None)
    rows = np.array(figure.axes).reshape(2, 2)
    assert [axes.axison for axes in rows[:, 1]] == [False, False]
    assert [text.get_text() for text in rows[0, 1].texts] == ["no flight"]


def test_boxes_are_drawn_where_they_stand_and_the_panel_holds_them(drawn: Callable[..., Figure]) -> None:
    corners = [[-8.0, 0.0], [-6.0, 2.0], [-7.0, 3.0], [-9.0, 1.0]]
    of = scene(0.0, apart=3.0, standoff=False) | {"boxes": [corners]}
    axes = drawn(of, scene(0.0, apart=3.0, standoff=False)).axes[0]
    (boxes,) = (one for one in axes.collections if isinstance(one, PolyCollection))
    (path,) = boxes.get_paths()
    np.testing.assert_array_equal(path.vertices[:4], corners)
    low, high = axes.get_xlim()
    assert low < -9.0 < high
    far = [[9000.0, 0.0], [9001.0, 0.0], [9001.0, 1.0], [9000.0, 1.0]]
    other = drawn(of | {"boxes": [corners, far]}, of).axes[0]
    assert other.get_xlim() == (low, high)
