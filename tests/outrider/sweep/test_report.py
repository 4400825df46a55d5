"""The report of a cell: every run counted once, in its kind, and the worst named first."""

from __future__ import annotations

import json
from io import StringIO
from math import inf
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from outrider.sweep.progress import duration
from outrider.sweep.report import WORST, CellReport, cell_report, document, exit_status
from outrider.sweep.runs import Ending, run_of
from outrider.sweep.table import show
from outrider.sweep.tasks import Entry

FIGURES = st.none() | st.floats(0.0, 100.0)
SUMMARIES = st.fixed_dictionaries(
    {
        "converged": st.none() | st.booleans(),
        "min_separation_m": FIGURES,
        "min_obstacle_distance_m": FIGURES,
        "d_min_violations": st.integers(0, 3),
        "failure": st.none() | st.just("the vehicles do not come to a hover"),
        "yaw_error_deg": st.none() | st.fixed_dictionaries({"p95": FIGURES}),
        "tracking_error_m": st.none() | st.fixed_dictionaries({"p95": FIGURES}),
    }
).flatmap(
    lambda summary: st.builds(
        lambda seconds: {**summary, "convergence_time_s": seconds if summary["converged"] else None},
        st.floats(0.0, 60.0),
    )
)
ENTRIES = st.lists(
    st.tuples(st.sampled_from(["done", "done", "done", "fault", "lost"]), SUMMARIES), max_size=30
).map(
    lambda rows: [
        Entry("ab", seed, status, None, summary, 1.0)
        if status == "done"
        else Entry("ab", seed, status, "it broke", None, 1.0)
        for seed, (status, summary) in enumerate(rows)
    ]
)


def entry(seed: int, **summary: Any) -> Entry:
    base = {"converged": True, "convergence_time_s": 7.0, "min_separation_m": 1.0, "d_min_violations": 0}
    return Entry("ab", seed, "done", None, {**base, **summary}, 1.0)


def report(entries: list[Entry]) -> CellReport:
    return cell_report("cell", "ab", [run_of(one) for one in entries], lambda seed: f"fly {seed}")


@given(ENTRIES)
def test_every_run_is_counted_once(entries: list[Entry]) -> None:
    found = report(entries)
    endings = [run_of(one).ending for one in entries]
    parts = (found.violations, found.failed, found.stuck, found.faults, found.lost)
    assert sum(parts) + endings.count(Ending.FINE) == found.runs == len(entries)
    assert found.ended == found.runs - found.faults - found.lost
    assert (exit_status([found]) == 0) == (not any(parts))
    assert (exit_status([found]) == 3) == bool(found.faults + found.lost)


@given(ENTRIES)
def test_a_report_is_json_and_a_table_whatever_is_in_it(entries: list[Entry]) -> None:
    found = report(entries)
    json.dumps(document("sweep", 0, [found]), allow_nan=False)
    paper = StringIO()
    show("sweep", [found, found], Console(file=paper, width=80))
    assert "runs" in paper.getvalue()


@given(ENTRIES)
def test_a_run_is_named_once_at_most_and_every_lost_one_is(entries: list[Entry]) -> None:
    named = [one.seed for one in report(entries).named]
    assert len(named) == len(set(named))
    bad = [one.seed for one in entries if one.status != "done"]
    assert set(bad) <= set(named)


def test_violations_come_first_then_what_did_not_arrive_then_the_nearest_and_the_slowest() -> None:
    entries = [
        entry(0, min_separation_m=0.9),
        entry(1, converged=False, convergence_time_s=None),
        entry(2, d_min_violations=1, min_separation_m=0.4),
        entry(3, d_min_violations=2, min_separation_m=0.3),
        entry(4, failure="no hover", converged=None, convergence_time_s=None, min_separation_m=None),
        *(entry(seed, convergence_time_s=7.0 + seed, min_separation_m=2.0) for seed in range(5, 12)),
    ]
    named = report(entries).named
    assert [(one.seed, one.why) for one in named] == [
        (3, "violation"),
        (2, "violation"),
        (4, "failed"),
        (1, "stuck"),
        (0, "nearest"),
        (5, "nearest"),
        (6, "nearest"),
        (11, "slowest"),
        (10, "slowest"),
        (9, "slowest"),
    ]
    assert named[0].command == "fly 3"
    assert WORST == 3


def test_a_stuck_run_is_longer_than_every_other() -> None:
    entries = [entry(seed) for seed in range(90)]
    entries += [entry(90 + seed, converged=False, convergence_time_s=None) for seed in range(10)]
    found = report(entries)
    assert found.time_p95 is not None
    assert found.time_p95.value == inf
    assert found.time_median is not None
    assert found.time_median == (7.0, 7.0, 7.0)
    assert found.time_worst == 7.0
    assert found.converged_rate is not None
    assert found.converged_rate.value == 0.9


@pytest.mark.parametrize("first", [None, 6.2])
def test_a_run_that_waits_for_the_others_is_stuck_without_them_only(first: float | None) -> None:
    """A vehicle whose companion has ended for good does not converge."""
    flown = entry(1, converged=False, convergence_time_s=None, others_converge_s=first)
    assert run_of(flown).ending is Ending.STUCK
    found = run_of(flown, others=True)
    stuck = first is None
    assert (found.ending is Ending.STUCK, found.converged) == (stuck, not stuck)
    assert found.seconds == (inf if stuck else first)
    violated = entry(1, converged=False, others_converge_s=first, d_min_violations=1)
    assert run_of(violated, others=True).ending is Ending.VIOLATION


def test_an_escort_has_no_time_to_converge() -> None:
    found = report([entry(seed, converged=None, convergence_time_s=None) for seed in range(5)])
    assert (found.converged, found.converged_rate, found.time_median, found.stuck) == (None, None, None, 0)
    assert run_of(entry(1, converged=None, convergence_time_s=None), others=True).ending is Ending.FINE
    assert exit_status([found]) == 0


def test_no_run_of_a_cell_ended() -> None:
    found = report([Entry("ab", 1, "lost", "its worker was killed by SIGKILL", None, 0.0)])
    assert (found.ended, found.separation.extreme, found.violation_rate) == (0, None, None)
    assert exit_status([found]) == 3


def test_obstacles_count_for_nearness() -> None:
    entries = [entry(0, min_separation_m=0.9), entry(1, min_separation_m=5.0, min_obstacle_distance_m=0.6)]
    assert [one.seed for one in report(entries).named if one.why == "nearest"] == [1, 0]


def test_time_left_in_words() -> None:
    assert [duration(s) for s in (0.0, 89.0, 120.0, 3600.0, 3900.0)] == [
        "0 s",
        "89 s",
        "2 min",
        "1 h 00 min",
        "1 h 05 min",
    ]
