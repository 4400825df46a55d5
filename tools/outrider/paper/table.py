"""Table of the paper's results beside the flown ones, for a terminal and in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite

from rich.console import Console
from rich.table import Table

from outrider.paper.results import Result
from outrider.paper.rows import Row

WIDTH = 120
_HEADS = (
    "scenario",
    "method",
    "paper, s",
    "median, s",
    "worst, s",
    "converged",
    "stuck",
    "least separation, m",
    "violations",
)


def show(rows: Sequence[Row], results: Sequence[Result], console: Console | None = None) -> None:
    """Write the table to standard output."""
    console = console or Console()
    if not console.is_terminal:
        console.width = WIDTH
    table = Table(title="the paper, flown again")
    for number, head in enumerate(_HEADS):
        table.add_column(head, justify="left" if number < 2 else "right")
    last = ""
    for row, words in _lines(rows, results):
        if last and row.scenario != last:
            table.add_section()
        table.add_row(*words)
        last = row.scenario
    console.print(table)


def markdown(rows: Sequence[Row], results: Sequence[Result]) -> str:
    """Return the same table as Markdown."""
    lines = [" | ".join(_HEADS), " | ".join("---" for _ in _HEADS)]
    lines += [" | ".join(words) for _, words in _lines(rows, results)]
    return "".join(f"| {line} |\n" for line in lines)


def _lines(rows: Sequence[Row], results: Sequence[Result]) -> Iterator[tuple[Row, tuple[str, ...]]]:
    for row, result in zip(rows, results, strict=True):
        yield (
            row,
            (
                row.scenario,
                row.method,
                row.reported,
                _seconds(result.median_s),
                _seconds(result.worst_s),
                f"{result.converged} of {result.seeds}",
                str(result.stuck),
                "" if result.min_separation_m is None else f"{result.min_separation_m:.2f}",
                str(result.d_min_violations),
            ),
        )


def _seconds(value: float | None) -> str:
    return "never" if value is None or not isfinite(value) else f"{value:.1f}"
