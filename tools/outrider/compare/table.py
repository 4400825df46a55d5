"""Table of a comparison for a terminal and in Markdown: ours beside the published rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.console import Console
from rich.table import Table

from outrider.compare.comparison import Bar, Comparison, Published
from outrider.compare.results import Result

WIDTH = 200
_HEADS = (
    "row",
    "planner",
    "delay, loss",
    "success",
    "mean, s",
    "all, s",
    "worst, s",
    "least, m",
    "surface, m",
    "path, m",
    "∫a²",
    "∫j²",
    "j, m/s³",
    "stops",
    "own d_min",
    "tube",
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
        " flights; worst: last arrival of all flights; j: largest jerk on an axis; own d_min: times that two"
        " vehicles came nearer than our scenario's; tube: times that a vehicle left the tube of its plan,"
        " after which all keep more distance for a while; plan: CPU time, p50 / p99, theirs as published;"
        f" delay and loss: of messages between vehicles; {_NOTHING}: not published, or does not exist"
    )


def markdown(comparison: Comparison, results: Sequence[Result]) -> str:
    """Return the same table as Markdown, with the sources of the published figures."""
    rows = [" | ".join(_HEADS), " | ".join("---" for _ in _HEADS)]
    rows += [" | ".join(words) for result in results for words in lines(comparison, result)]
    machines = sorted({name for result in results for name in result.processors})
    notes = [f"- {text}" for text in (*comparison.unlike, *sources(comparison))]
    notes += [f"- outrider: plans of this table on {name}" for name in machines]
    return (
        "".join(f"| {line} |\n" for line in rows)
        + "\n"
        + caption(comparison)
        + "\n\n"
        + "\n".join(notes)
        + "\n"
    )


def sources(comparison: Comparison) -> list[str]:
    """Return a sentence for each planner and source: where its figures are from, and its processor."""
    return list(
        dict.fromkeys(
            f"{one.planner}: {one.source}{f'; plans on {one.processor}' if one.processor else ''}"
            f"{f'; {one.note}' if one.note else ''}"
            for one in comparison.published
        )
    )


def lines(comparison: Comparison, result: Result) -> Iterator[tuple[str, ...]]:
    """Yield the published lines of a row, then ours."""
    for one in comparison.published:
        if one.row == result.row:
            yield _published(one)
    bars = {row.label: row.bar for row in comparison.rows}
    yield (
        result.row,
        f"outrider ({result.vehicle}{_PHYSICS if result.motion == 'multirotor' else ''})",
        f"{result.delay_ms:g} ms, {100.0 * result.loss:g} %",
        f"{result.succeeded} of {result.seeds}",
        _number(result.mean_s, 2),
        _number(result.last_s, 2),
        _number(result.worst_s, 2),
        _number(result.separation_m, 3),
        _number(result.obstacle_m, 3),
        _number(result.path_m, 2),
        _number(result.acceleration2, 0),
        _number(result.jerk2, 0),
        _number(result.most_jerk, 1),
        _number(result.stops, 2),
        str(result.violations),
        str(result.left_tube),
        f"{_number(result.plan_ms_p50, 2)} / {_number(result.plan_ms_p99, 2)}",
        _bar(bars.get(result.row), result.reaches_bar),
    )


def _published(one: Published) -> tuple[str, ...]:
    return (
        one.row,
        one.planner,
        "",
        _NOTHING if one.success is None else f"{100.0 * one.success:g} %",
        _number(one.mean_s, 2),
        _number(one.last_s, 2),
        _number(one.worst_s, 2),
        _NOTHING,
        _NOTHING,
        _number(one.path_m, 2),
        _number(one.acceleration2, 0),
        _number(one.jerk2, 0),
        _NOTHING,
        _number(one.stops, 2),
        "",
        "",
        _number(one.plan_ms, 1),
        "",
    )


def _bar(bar: Bar | None, reached: bool | None) -> str:
    """Return the limits of a bar, and whether the row reaches them."""
    if bar is None or reached is None:
        return ""
    limits = (("mean", bar.mean_s), ("all", bar.last_s), ("plan", bar.plan_ms))
    words = [f"{name} {most:g}" for name, most in limits if most is not None]
    words.append(f"success {100.0 * bar.success:g} %")
    return f"{', '.join(words)}: {'reached' if reached else 'missed'}"


def _number(value: float | None, decimals: int) -> str:
    return _NOTHING if value is None else f"{value:.{decimals}f}"
