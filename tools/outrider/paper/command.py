"""Command ``outrider paper``: flies every row with every seed, resumable, and writes table and figures."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from outrider.interruption import INTERRUPTED
from outrider.paper import figures
from outrider.paper.flying import RUN, TRACED
from outrider.paper.results import Result, result_of
from outrider.paper.rows import ROWS, Response, Row, cells_of
from outrider.paper.table import markdown, show
from outrider.runs import whole_file
from outrider.sweep import directory as places
from outrider.sweep.cells import Cell
from outrider.sweep.comparison import Flown, flown
from outrider.sweep.execution import header
from outrider.sweep.runs import run_of
from outrider.sweep.workers import Machines


def paper(
    seeds: int = 10,
    jobs: int | None = None,
    out: Path | None = None,
    as_json: bool = False,
    rows: tuple[Row, ...] = ROWS,
    run: str = RUN,
    response: Response = "exact",
) -> int:
    """Fly the paper's table on autopilots of the given ``response`` and return the exit status.

    The status is 0 if all was flown, 1 after a violation of d_min or a failed run, and 3 after an
    interruption. A row that gets stuck is a result, not an error. Writes ``paper.json``, ``paper.md`` and
    figures beside the journal in ``out`` (default ``runs/sweep-paper``, for the response ``firmware``
    ``runs/sweep-paper-firmware``).
    """
    found = cells_of(rows, response)
    name = "paper" if response == "exact" else f"paper-{response}"
    folder = places.prepare(out, name)
    numbers = range(TRACED, TRACED + seeds)
    entries = flown(header(name, found), found, numbers, folder, run, Machines(jobs))
    if entries is None:
        return INTERRUPTED
    results = [
        result_of(row, [run_of(entries[cell.key, seed]) for seed in numbers])
        for row, cell in zip(rows, found, strict=True)
    ]
    traces = _traces(rows, found, entries)
    document = {"response": response, "rows": [result.document() for result in results]}
    whole_file.write(folder / "paper.json", json.dumps(document, indent=2) + "\n")
    whole_file.write(folder / "paper.md", markdown(rows, results))
    figures.draw(rows, results, traces, folder)
    if as_json:
        sys.stdout.write(json.dumps(document) + "\n")
    else:
        show(rows, results)
    sys.stderr.write(f"table, Markdown and figures: {folder}\n")
    return _status(results)


def _traces(rows: tuple[Row, ...], found: list[Cell], entries: Flown) -> dict[Row, dict[str, Any]]:
    """Return the traces of the seed that is drawn, for rows that have one."""
    traces = {}
    for row, cell in zip(rows, found, strict=True):
        summary = entries[cell.key, TRACED].summary
        if summary is not None and "trace" in summary:
            traces[row] = summary["trace"]
    return traces


def _status(results: list[Result]) -> int:
    return 1 if any(result.d_min_violations or result.failed for result in results) else 0
