"""Table of a comparison for a terminal and in Markdown: ours beside the published rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.console import Console
from rich.table import Table

from outrider.compare.comparison import Comparison, Published
from outrider.compare.results import Result

WIDTH = 160
_HEADS = (
    "row",
    "planner",
    "success",
    "mean, s",
    "all, s",
    "worst, s",
    "least, m",
    "surface, m",
    "path, m",
    "∫a²",
    "∫j²",
    "stops",
    "plan, ms",
    "bar",
)
_NOTHING, _PHYSICS = "–", ", full physics"


def show(comparison: Comparison, results: Sequence[Result], console: Console | None = None) -> None:
    """Write the table to standard output."""
    console = console or Console()
    if not console.is_terminal:
        console.width = WIDTH
    table = Table(title=f"{comparison.name}: {comparison.description}", caption=caption(comparison))
    for number, head in enumerate(_HEADS):
        table.add_column(head, justify="left" if number < 2 else "right")
    for result in results:
        for words in lines(comparison, result):
            table.add_row(*words)
        table.add_section()
    console.print(table)


def caption(comparison: Comparison) -> str:
    """Return what the columns mean."""
    measure = comparison.measure
    limits = f"within {comparison.goal_radius:g} m, and no two are nearer than {measure.least:g} m"
    if measure.obstacle is not None:
        limits += f", none is nearer to an obstacle than {measure.obstacle:g} m"
    return (
        f"success: all arrive {limits} ({measure.kind}); mean over vehicles; all: last arrival, mean over"
        f" flights; worst: last arrival of all flights; plan: CPU time, p50 / p99; {_NOTHING}: not published"
    )


def markdown(comparison: Comparison, results: Sequence[Result]) -> str:
    """Return the same table as Markdown, with the sources of the published figures."""
    rows = [" | ".join(_HEADS), " | ".join("---" for _ in _HEADS)]
    rows += [" | ".join(words) for result in results for words in lines(comparison, result)]
    sources = dict.fromkeys(f"{one.planner}: {one.source}" for one in comparison.published)
    notes = [*(f"- {text}" for text in comparison.unlike), *(f"- {text}" for text in sources)]
    return (
        "".join(f"| {line} |\n" for line in rows)
        + "\n"
        + caption(comparison)
        + "\n\n"
        + "\n".join(notes)
        + "\n"
    )


def lines(comparison: Comparison, result: Result) -> Iterator[tuple[str, ...]]:
    """Yield the published lines of a row, then ours."""
    for one in comparison.published:
        if one.row == result.row:
            yield _published(one)
    bar = {None: "", True: "reached", False: "missed"}[result.reaches_bar]
    yield (
        result.row,
        f"outrider ({result.vehicle}{_PHYSICS if result.motion == 'multirotor' else ''})",
        f"{result.succeeded} of {result.seeds}",
        _number(result.mean_s, 2),
        _number(result.last_s, 2),
        _number(result.worst_s, 2),
        _number(result.separation_m, 3),
        _number(result.obstacle_m, 3),
        _number(result.path_m, 2),
        _number(result.acceleration2, 0),
        _number(result.jerk2, 0),
        _number(result.stops, 2),
        f"{_number(result.plan_ms_p50, 2)} / {_number(result.plan_ms_p99, 2)}",
        bar,
    )


def _published(one: Published) -> tuple[str, ...]:
    return (
        one.row,
        one.planner,
        _NOTHING if one.success is None else f"{100.0 * one.success:g} %",
        _number(one.mean_s, 2),
        _number(one.last_s, 2),
        _number(one.worst_s, 2),
        _NOTHING,
        _NOTHING,
        _number(one.path_m, 2),
        _number(one.acceleration2, 0),
        _number(one.jerk2, 0),
        _number(one.stops, 2),
        _number(one.plan_ms, 1),
        "",
    )


def _number(value: float | None, decimals: int) -> str:
    return _NOTHING if value is None else f"{value:.{decimals}f}"
