"""Command ``outrider sweep``: flies a sweep file and prints its table; resumable at any time."""

from __future__ import annotations

import json
import shlex
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from outrider.interruption import INTERRUPTED
from outrider.resources import find
from outrider.runs import whole_file
from outrider.sweep import directory as places
from outrider.sweep import page, picture, regressions, tables
from outrider.sweep.cells import Cell, cells, task, waits_for_others
from outrider.sweep.execution import WALL_LIMIT_S, has_ended, header, work
from outrider.sweep.flying import RUN
from outrider.sweep.grid import Sweep
from outrider.sweep.journal import Journal, opened
from outrider.sweep.progress import ResultCounter, duration, watching
from outrider.sweep.report import CellReport, cell_report, document, exit_status
from outrider.sweep.runs import Run, run_of
from outrider.sweep.table import show
from outrider.sweep.tasks import Task
from outrider.sweep.workers import Machines
from outrider.yaml_files.yaml_file import load


def sweep(
    name: str,
    runs: int | None = None,
    jobs: int | None = None,
    out: Path | None = None,
    as_json: bool = False,
    wall_limit_s: float = WALL_LIMIT_S,
    run: str = RUN,
    scheduler: str | None = None,
    failures: Path | None = None,
) -> int:
    """Fly the sweep ``name``, a file or a shipped sweep, show its summary and return the exit status.

    The status is 0 if all runs ended well, 1 after a violation of d_min or a goal not reached, and 3 if a run
    raised an error or is finally lost, or if the sweep was interrupted. Raises InputError for invalid input
    before anything is flown. ``runs`` replaces the file's number of seeds. ``jobs`` is the number of workers,
    by default one for each core; the alternative is a Dask ``scheduler`` with its workers. ``wall_limit_s``
    is the longest wall time of one run. ``run`` is the function that a worker calls, ``module:function``.
    Runs that failed are written to the folder ``failures`` as scenarios.
    """
    path = find("sweeps", name)
    spec = load(path, Sweep)
    if runs is not None:
        spec = spec.model_copy(update={"runs": runs})
    found = cells(spec, str(path))
    machines = Machines(jobs, scheduler, wall_limit_s)
    if failures is not None:
        regressions.prepare(failures)
    folder = places.prepare(out, spec.name)
    with ExitStack() as open_:
        began = time.perf_counter()
        journal = open_.enter_context(opened(folder / places.JOURNAL, header(spec.name, found)))
        tasks = [task(cell, seed) for seed in spec.seeds for cell in found]
        waiting = [one for one in tasks if not has_ended(journal, one)]
        labels = {cell.key: cell.label for cell in found}
        others = {cell.key for cell in found if waits_for_others(cell)}
        with watching(len(tasks), len(tasks) - len(waiting), others) as watch:
            # Runs at every exit, after the bar is closed.
            open_.callback(_name_losses, watch, labels)
            stopped = None
            if waiting:
                workers = open_.enter_context(machines.workers(run))
                stopped = work(journal, waiting, watch, workers)
        if stopped is not None:
            left = sum(not has_ended(journal, one) for one in tasks)
            again = _again(name, folder, runs, scheduler, failures, wall_limit_s)
            sys.stderr.write(
                f"{stopped} after {len(tasks) - left} of {len(tasks)} runs, which are kept; this goes on "
                f"with the rest: {again}\n"
            )
            return INTERRUPTED
        wall = time.perf_counter() - began
        status = _conclude(spec, found, journal, folder, as_json, _Effort(waiting, watch, wall))
        if failures is not None:
            runs_of = {cell.key: _runs(journal, cell, spec) for cell in found}
            files = regressions.write(failures, spec.name, found, runs_of)
            sys.stderr.write(f"{len(files)} runs that failed are scenarios in {failures}\n")
        return status


def _again(
    name: str,
    folder: Path,
    runs: int | None,
    scheduler: str | None,
    failures: Path | None,
    wall_limit_s: float,
) -> str:
    """Return the command that resumes the sweep."""
    words = ["outrider", "sweep", name]
    for option, value, usual in (
        ("--runs", runs, None),
        ("--out", folder, None),
        ("--scheduler", scheduler, None),
        ("--regressions", failures, None),
        ("--wall-limit", wall_limit_s, WALL_LIMIT_S),
    ):
        words += [] if value == usual else [option, str(value)]
    return shlex.join(words)


def _name_losses(watch: ResultCounter, labels: dict[str, str]) -> None:
    for entry in watch.lost:
        sys.stderr.write(f"lost: {labels[entry.key]}, seed {entry.seed}: {entry.what}\n")


class _Effort:
    """Effort of this attempt; it is not part of the result."""

    def __init__(self, flown: Sequence[Task], watch: ResultCounter, wall_s: float) -> None:
        self.flown, self.lost, self.wall_s = len(flown), watch.lost, wall_s

    def document(self, labels: dict[str, str]) -> dict[str, Any]:
        """Return values of JSON, which name every run that lost its worker, retried or not."""
        lost = [{"cell": labels[one.key], "seed": one.seed, "what": one.what} for one in self.lost]
        return {"flown_now": self.flown, "wall_s": round(self.wall_s, 3), "lost_on_the_way": lost}


def _conclude(
    spec: Sweep, found: Sequence[Cell], journal: Journal, folder: Path, as_json: bool, effort: _Effort
) -> int:
    runs = {cell.key: _runs(journal, cell, spec) for cell in found}
    reports = [_report(folder, cell, runs[cell.key]) for cell in found]
    summary = document(spec.name, spec.first_seed, reports)
    whole_file.write(folder / places.SUMMARY, json.dumps(summary, indent=2) + "\n")
    picture.draw(spec.name, reports, runs, folder / places.PICTURE)
    page.write(folder / page.PAGE, spec.name, reports, folder / places.PICTURE)
    tables.write(folder, reports, runs)
    labels = {cell.key: cell.label for cell in found}
    if as_json:
        whole = {**summary, "sweep_dir": str(folder), "wall": effort.document(labels)}
        sys.stdout.write(json.dumps(whole) + "\n")
    else:
        show(spec.name, reports)
    if effort.flown:
        pace = 60.0 * effort.flown / effort.wall_s
        sys.stderr.write(f"{effort.flown} runs in {duration(effort.wall_s)}, {pace:.0f} a minute; {folder}\n")
    return exit_status(reports)


def _report(folder: Path, cell: Cell, runs: Sequence[Run]) -> CellReport:
    return cell_report(cell.label, cell.key, runs, lambda seed: places.command(folder, cell, seed))


def _runs(journal: Journal, cell: Cell, spec: Sweep) -> list[Run]:
    others = waits_for_others(cell)
    return [run_of(journal.entries[cell.key, seed], others=others) for seed in spec.seeds]
