"""Command ``outrider report``: writes the report page of a run directory."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

from outrider.errors import InputError
from outrider.report import cameras, clocks
from outrider.report.charts import charts, histogram
from outrider.report.distances import encounters
from outrider.report.events import Event, events
from outrider.report.headline import Headline, headline
from outrider.report.loss import LossComparison, Losses
from outrider.report.page import MARK, page
from outrider.report.reading import Watch, read
from outrider.report.replay import document
from outrider.report.run import Log, Motions, Run
from outrider.report.tables import event_table, fact_list, gap_list, loss_tables, summary_table
from outrider.report.thinning import chosen
from outrider.runs import whole_file

NAME = "report.html"


class ReportPage(NamedTuple):
    """Report page, and the data on it."""

    text: str
    run: Run
    events: tuple[Event, ...]
    losses: Losses


def report(directory: Path, out: Path | None = None, as_json: bool = False) -> int:
    """Write the page of the run in ``directory``, print its path and return the exit status.

    With ``as_json`` a JSON object with the path and key figures is printed instead of the path. The page goes
    to ``out``, by default to ``report.html`` in the directory. Raises InputError if the directory holds no
    run, or if the destination exists and is not a report.
    """
    from outrider.terminal.share_progress import share_progress

    path = directory / NAME if out is None else out
    if directory.is_dir():
        check(path)
    with share_progress() as watch:
        made = make(directory, watch)
    write(path, made.text)
    if as_json:
        sys.stdout.write(json.dumps(_document(path, made)) + "\n")
    else:
        for gap in made.run.gaps:
            sys.stderr.write(f"{gap.what}: {gap.why}\n")
        sys.stdout.write(f"{path}\n")
    return 0


def make(directory: Path, watch: Watch = lambda _what, _share: None) -> ReportPage:
    """Return the page of a run without writing it. Raises InputError if the directory holds no run."""
    counting, ahead = LossComparison(), dict[int, float]()

    def sift(log: Log, motions: Motions | None) -> Log:
        if motions is not None:
            ahead[log.owner] = clocks.offset(log, motions)
        counting.take(log, ahead.get(log.owner))
        return log._replace(received={})

    run = read(directory, watch, sift)
    motions, lost = run.motions, counting.close()
    near = [] if motions is None else encounters(motions, _d_min(run), run.scenario)
    happened = events(run, near, ahead, 0.0 if motions is None else float(motions.time[-1]))
    replay = None if motions is None else _replay(run, motions, lost, ahead, happened)
    said = headline(run, lost.share)
    text = page(_title(run), said, _parts(run, said, happened, lost), replay)
    return ReportPage(text, run, tuple(happened), lost)


def _d_min(run: Run) -> float:
    """Return d_min (m); 0 if it is unknown, so that no distance violates it."""
    said = run.summary.get("d_min_m") if run.scenario is None else run.scenario.d_min
    return float(said) if isinstance(said, int | float) else 0.0


def _replay(
    run: Run, motions: Motions, lost: Losses, ahead: dict[int, float], happened: Sequence[Event]
) -> str:
    shown = chosen(motions)
    drawn = charts(run, motions, shown, lost, clocks.errors(run.logs, ahead))
    views = cameras.views(run, motions.system, motions.time[shown], ahead)
    return document(run, motions, shown, drawn, histogram(run.plan_times), happened, views)


def _title(run: Run) -> str:
    certified = run.summary.get("avoidance") == "certified"
    method, seed = "certified" if certified else run.summary.get("method"), run.seed
    words = [run.name, str(method or ""), "" if seed is None else f"seed {seed}"]
    return " · ".join(word for word in words if word)


def _parts(run: Run, said: Headline, happened: Sequence[Event], lost: Losses) -> dict[str, str]:
    """Return the HTML of the template's placeholders."""
    share = lost.share
    return {
        "facts": fact_list(said.facts),
        "gaps": gap_list(run.gaps),
        "summary": summary_table(run.summary) if run.summary else "<p>There is no summary.</p>",
        "events": event_table(happened),
        "loss": loss_tables(lost),
        "share": "" if share is None else f"In all, {100.0 * share:.1f} % did not arrive.",
        "configuration": escape(run.configuration or "There is no configuration."),
    }


def check(path: Path) -> None:
    """Raise InputError if the folder of ``path`` is missing, or ``path`` exists and is not a report."""
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}")
    if path.is_symlink() or path.exists():
        if not path.is_file():
            raise InputError(f"{path}: exists and is not a report; nothing is overwritten")
        with path.open("rb") as file:
            if MARK.encode() not in file.read(1024):
                raise InputError(f"{path}: exists and is not a report; nothing is overwritten")


def write(path: Path, text: str) -> None:
    """Write the page atomically. Raises InputError as ``check`` does."""
    check(path)
    whole_file.write(path, text)


def _document(path: Path, made: ReportPage) -> dict[str, object]:
    share = made.losses.share
    return {
        "report": str(path),
        "bytes": path.stat().st_size,
        "events": len(made.events),
        "lost": None if share is None else round(share, 4),
        "missing": [gap._asdict() for gap in made.run.gaps],
    }
