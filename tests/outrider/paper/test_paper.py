"""``outrider paper`` as a whole, with runs that take no time, and what its rows fly."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from outrider.paper.command import paper
from outrider.paper.flying import fly
from outrider.paper.rows import ROWS, SENSORS, Row, cells_of
from outrider.sweep.cells import scenario_of, task

THREE = (
    Row("scenario-2", "baseline", "30"),
    Row("scenario-2", "swivel", "15"),
    Row("antipodal-8", "tangential", "11"),
)
KEYS = {
    "scenario", "method", "avoidance", "seeds", "converged", "median_s", "worst_s", "min_separation_m",
    "d_min_violations", "stuck", "failed",
}  # fmt: skip


def test_every_row_flies_what_it_says() -> None:
    cells = cells_of(ROWS)
    assert len({cell.key for cell in cells}) == len(cells) == len(set(ROWS))
    for row, cell in zip(ROWS, cells, strict=True):
        flown = scenario_of(task(cell, 1))
        assert (flown.name, flown.companion.methods, flown.sensors) == (row.scenario, (row.method,), SENSORS)
        # The paper's limits, unchanged.
        limits, field = flown.companion.limits, flown.companion.field
        assert (limits.u_max, limits.v_max) == ((2.0,) * 3, (5.0,) * 3)
        assert (limits.box_min, limits.box_max) == ((-20.0, -20.0, 3.0), (20.0, 20.0, 10.0))
        assert (field.d_min, field.d_safe, flown.d_min) == (0.5, 3.0, 0.5)
        assert flown.companion.rates.replan_us == 10_000
        assert flown.links.swarm.delay_ms == 20.0


def test_a_response_is_all_that_differs() -> None:
    for exact, real in zip(cells_of(THREE), cells_of(THREE, "firmware"), strict=True):
        one, other = scenario_of(task(exact, 1)), scenario_of(task(real, 1))
        assert (one.autopilot.response, other.autopilot.response) == ("exact", "firmware")
        assert one.model_copy(update={"autopilot": other.autopilot}) == other
        assert exact.key != real.key


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_table_is_that_of_the_runs(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert paper(4, out=Path("out"), as_json=True, rows=THREE, run="tests.outrider.paper.runs:table") == 1
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [set(row) for row in rows] == [KEYS] * 3
    stuck, fine, near = rows
    assert (stuck["converged"], stuck["stuck"], stuck["median_s"], stuck["worst_s"]) == (0, 4, None, None)
    assert (fine["converged"], fine["median_s"], fine["worst_s"]) == (4, 2.0, 4.0)
    assert (fine["d_min_violations"], fine["min_separation_m"]) == (0, 1.1)
    assert (near["d_min_violations"], near["min_separation_m"]) == (1, 0.4)
    assert json.loads(Path("out/paper.json").read_text())["rows"] == rows
    table = Path("out/paper.md").read_text()
    assert "| scenario-2 | swivel | 15 | 2.0 | 4.0 | 4 of 4 | 0 | 1.10 | 0 |" in table
    assert "| scenario-2 | baseline | 30 | never | never | 0 of 4 | 4 |" in table
    for picture in ("baseline", "swivel", "tangential", "times"):
        assert Path(f"out/{picture}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_without_a_violation_being_stuck_is_a_result(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert paper(2, out=Path("out"), rows=THREE, run="tests.outrider.paper.runs:fine") == 0
    said = capsys.readouterr()
    assert "tangential" in said.out
    assert "out" in said.err


@pytest.mark.slow
def test_what_was_flown_is_not_flown_again(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paper(2, out=Path("out"), rows=THREE, run="tests.outrider.paper.runs:fine")
    before = Path("out/journal.jsonl").read_bytes()
    paper(3, out=Path("out"), rows=THREE, run="tests.outrider.paper.runs:fine")
    after = Path("out/journal.jsonl").read_bytes()
    assert after.startswith(before)
    assert after.count(b"\n") == before.count(b"\n") + 3
    capsys.readouterr()


def test_a_flight_of_the_table_leaves_its_trace() -> None:
    (cell,) = cells_of((Row("scenario-3", "baseline", "stuck"),))
    document = json.loads(cell.document)
    document["cap_s"] = 2.0
    document["companion"]["rates"]["replan_us"] = 50_000
    one = task(cell._replace(document=json.dumps(document)), 1)
    result = fly(one)
    trace = result["trace"]
    times = len(trace["time_s"])
    assert times == 20
    assert [len(row) for row in trace["position"]] == [5] * times
    assert [len(row) for row in trace["gradient"]] == [1] * times
    # It has 12 m to go, less what the horizon reaches, and counts them twice.
    assert 10.0 < max(row[0] for row in trace["gradient"]) < 30.0
    assert "trace" not in fly(one._replace(seed=2))
