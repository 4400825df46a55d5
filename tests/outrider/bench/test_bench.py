"""The benchmark's stages and its comparison with an earlier one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from outrider.bench import fusion, stages, start
from outrider.bench.comparison import earlier, ratios
from outrider.bench.receive import receiving
from outrider.errors import InputError


def test_every_stage_is_timed_and_left_as_it_was() -> None:
    every = [*stages.FIELD.values(), *stages.CERTIFIED.values()]
    before = {(owner, name): getattr(owner, name) for owner, name in every}
    found = stages.measured()
    assert set(found["field"]) == set(stages.FIELD)
    assert set(found["certified"]) == set(stages.CERTIFIED)
    assert all(value > 0.0 for part in found.values() for value in part.values())
    assert before == {(owner, name): getattr(owner, name) for owner, name in before}


def test_receiving_is_timed_for_positions_and_plans() -> None:
    found = receiving(1)
    assert set(found) == {"position", "plan"}
    assert all(0.0 < times["converted"] < times["whole"] for times in found.values())


def test_the_fusion_is_measured_with_detections_that_are_all_used() -> None:
    found = fusion.figures(1, plan_ms=0.2)
    parts = [found[name] for name in fusion.Costs._fields]
    assert all(part > 0.0 for part in parts)
    assert found["all"] == pytest.approx(sum(parts), abs=0.3)
    assert found["share_of_plan"] == pytest.approx(found["all"] / 200.0, abs=1e-3)
    assert found["share_of_period"] == pytest.approx(found["all"] / 50_000.0, abs=1e-5)


def test_figures_of_both_benchmarks_are_compared(tmp_path: Path) -> None:
    before = {"plan_step_ms": {"field": {"p50": 0.4}}, "gone": 1.0, "nothing": 0, "machine": "one"}
    now = {"plan_step_ms": {"field": {"p50": 0.1}}, "new": 1.0, "nothing": 3, "machine": "one"}
    path = tmp_path / "bench.json"
    path.write_text(json.dumps(before))
    (one,) = ratios(earlier(path), now)
    assert (one.name, one.before, one.now, one.ratio) == ("plan_step_ms.field.p50", 0.4, 0.1, 0.25)


@pytest.mark.parametrize("text", ["", "[]", "{}", "\x00", '{"plan_step": 1}'])
def test_a_file_that_is_no_benchmark_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "bench.json"
    path.write_text(text)
    with pytest.raises(InputError, match="is no benchmark; allowed: the output of outrider bench --json"):
        earlier(path)


def test_a_file_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        earlier(tmp_path / "none.json")


@pytest.mark.slow
def test_a_start_of_fly_is_measured_in_both_processes() -> None:
    """The limit of memory holds with every optional package installed.

    It is one of anonymous pages: all together were 185 MiB on one day and 215 on another, on one machine.
    """
    start.measured()
    figures = start.measured()
    assert figures["cpu_s"] > 0.1
    assert figures["largest_mib"] < 2.0 * figures["memory_mib"]
    assert 50.0 < figures["anonymous_mib"] <= 110.0
    assert figures["anonymous_mib"] < figures["memory_mib"]
