"""Summary of a sweep as a table for people."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, isfinite

from rich.console import Console
from rich.table import Table
from rich.text import Text

from outrider.sweep.report import METHOD, CellReport, Named, Spread
from outrider.sweep.statistics import Interval

WIDTH = 120
"""Width in characters if there is no terminal."""
MOST_NAMED = 12
_WORDS_WIDTH, _CELL_WIDTH = 42, 26
_ORDER = ("violation", "failed", "stuck", "fault", "lost", "nearest", "slowest")


def show(name: str, cells: Sequence[CellReport], console: Console | None = None) -> None:
    """Write the table to standard output, then the worst runs with the commands that replay them."""
    console = console or Console()
    if not console.is_terminal:
        console.width = WIDTH
    together = max(1, (console.width - _WORDS_WIDTH) // _CELL_WIDTH)
    for first in range(0, len(cells), together):
        console.print(_table(name, cells[first : first + together]))
    console.print(Text(METHOD, style="dim"))
    named = [(cell, one) for cell in cells for one in cell.named]
    named.sort(key=lambda pair: _ORDER.index(pair[1].why))
    for cell, one in named[:MOST_NAMED]:
        console.print(Text(f"\n{_reason(cell, one)}"))
        # Not wrapped, so that it can be copied.
        console.print(Text(f"  {one.command}"), soft_wrap=True)
    if len(named) > MOST_NAMED:
        console.print(Text(f"\nand {len(named) - MOST_NAMED} more in the summary"))


def _table(name: str, cells: Sequence[CellReport]) -> Table:
    """Return a table with a column for each cell, so that compared values stand side by side."""
    table = Table(title=f"sweep {name}")
    table.add_column("", no_wrap=True)
    for cell in cells:
        table.add_column(Text(cell.label), justify="right", overflow="fold")
    for words, texts in rows(cells):
        table.add_row(words, *texts)
    return table


def rows(cells: Sequence[CellReport]) -> list[tuple[str, list[str]]]:
    """Return the name of each figure and its text for each cell; figures without any text are omitted."""
    found = [(words, [text_of(cell) for cell in cells]) for words, text_of in _ROWS]
    return [(words, texts) for words, texts in found if any(texts)]


def _reason(cell: CellReport, one: Named) -> str:
    words = [f"{one.why}: {cell.label}, seed {one.seed}"]
    if one.min_separation_m is not None:
        words.append(f"{one.min_separation_m:g} m")
    if one.convergence_time_s is not None:
        words.append(f"{one.convergence_time_s:g} s")
    if one.what:
        words.append(one.what)
    return ", ".join(words)


def _share(count: int | None, value: Interval | None) -> str:
    if count is None or value is None:
        return ""
    return f"{count} ({100 * value.low:.1f} to {100 * value.high:.1f} %)"


def _seconds(value: Interval | None) -> str:
    """Return a time with its interval: the lower bound is at least 0, a missing bound is ∞."""
    if value is None:
        return ""
    if value.low == inf:
        return "never"
    middle = f"{value.value:.2f}" if isfinite(value.value) else "never"
    low, high = (f"{end:.2f}" if isfinite(end) else "∞" for end in (max(value.low, 0.0), value.high))
    return f"{middle} ({low} to {high})"


def _distances(value: Spread) -> str:
    return " / ".join(f"{v:.2f}" for v in (value.extreme, value.tail, value.median) if v is not None)


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _count(number: int) -> str:
    """Return the number as text, empty for 0: an empty row is omitted."""
    return str(number) if number else ""


_ROWS: tuple[tuple[str, Callable[[CellReport], str]], ...] = (
    ("runs", lambda cell: str(cell.runs)),
    ("converged", lambda cell: _share(cell.converged, cell.converged_rate)),
    ("stuck", lambda cell: _count(cell.stuck)),
    ("with a violation", lambda cell: _share(cell.violations, cell.violation_rate)),
    ("failed", lambda cell: _count(cell.failed)),
    ("at fault", lambda cell: _count(cell.faults)),
    ("lost", lambda cell: _count(cell.lost)),
    ("time to converge, s: median", lambda cell: _seconds(cell.time_median)),
    ("… p95", lambda cell: _seconds(cell.time_p95)),
    ("… worst", lambda cell: _number(cell.time_worst, 2)),
    ("separation, m: least / p5 / median", lambda cell: _distances(cell.separation)),
    ("to obstacles, m: least / p5 / median", lambda cell: _distances(cell.to_obstacle)),
    ("yaw error p95, deg: median", lambda cell: _number(cell.yaw.median, 1)),
    ("tracking error p95, m: median", lambda cell: _number(cell.tracking.median, 3)),
)
