"""Command ``outrider replay --certify``: from a run directory to its verdict."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from outrider.certify.histories import Kind
from outrider.certify.reading import read
from outrider.certify.verdict import Verdict, judge
from outrider.terminal.share_progress import share_progress

MOST_SHOWN = 20


def certify(directory: Path, as_json: bool = False) -> int:
    """Judge the run in ``directory`` and report; return 0 if it is certified, 1 if there are findings.

    Raises InputError for a directory without evidence.
    """
    with share_progress() as watch:
        evidence = read(directory, watch)
    verdict = judge(evidence)
    if as_json:
        sys.stdout.write(json.dumps(verdict.document()) + "\n")
    else:
        show(str(directory), verdict)
    return 0 if verdict.certified else 1


def _fixed(verdict: Verdict) -> dict[str, object]:
    """Return the rows about fixed obstacles; none where no plan was near one."""
    fixed, nearest = verdict.fixed, verdict.fixed.nearest
    if nearest is None:
        return {}
    who = f"{nearest.system} at {verdict.seconds(nearest.time):g} s from {nearest.obstacle}"
    return {
        "plans checked against fixed obstacles near them": fixed.checked,
        "least distance from a fixed obstacle, m": f"{nearest.distance:.4f}, {who}",
        "required from fixed obstacles, m": f"{verdict.surface:.4f}",
    }


def show(name: str, verdict: Verdict) -> None:
    """Print the verdict as a table, then up to 20 findings and up to 20 anchors, one per line."""
    pairs, nearest = verdict.pairs, verdict.pairs.nearest
    anchors = verdict.steps(Kind.ANCHOR)
    word = "certified" if verdict.certified else "not certified"
    exceptions = {"pairs of plans after an anchor": pairs.resting, "pairs that began too near": pairs.near}
    if verdict.certified and any(exceptions.values()):
        word += " but for " + " and ".join(f"{count} {what}" for what, count in exceptions.items() if count)
    table = Table(show_header=False)
    rows = {
        "vehicles": len(verdict.histories),
        "epochs": len(pairs.epochs),
        "pairs of plans checked": pairs.checked,
        "… not checked after a farewell": pairs.farewell,
        "… not checked after an anchor": pairs.resting,
        "pairs of vehicles that began nearer than required": pairs.near,
        "least distance of two plans, m": ""
        if nearest is None
        else f"{nearest.distance:.4f}, {nearest.who[0]} and {nearest.who[1]} at "
        f"{verdict.seconds(nearest.epoch):g} s",
        "required, m": f"{verdict.required:.4f}",
        "agreements": verdict.agreements,
        "plans checked against their planes": verdict.kept,
        **_fixed(verdict),
        "plans made": verdict.plans,
        "plans carried on": len(verdict.steps(Kind.CARRIED_ON)),
        "anchors": len(anchors),
        "farewells": sum(len(history.leaves) for history in verdict.histories),
        "times outside a tube, and by how much at most, m": f"{verdict.outside[0]}, {verdict.outside[1]:.2f}",
        "damaged records": verdict.damaged,
        "findings": len(verdict.findings),
    }
    for words, value in rows.items():
        table.add_row(words, str(value))
    console = Console()
    # Printed above the table, so that a long name is not broken.
    console.print(Text(f"{name} · {word}"), soft_wrap=True)
    console.print(table)
    lines = [verdict.line(finding) for finding in verdict.findings]
    sent = [f"anchor: {system}, {verdict.seconds(epoch):g} s" for system, epoch in anchors]
    for group in (lines, sent):
        for line in group[:MOST_SHOWN]:
            console.print(Text(line), soft_wrap=True)
        if len(group) > MOST_SHOWN:
            console.print(Text(f"and {len(group) - MOST_SHOWN} more"))
