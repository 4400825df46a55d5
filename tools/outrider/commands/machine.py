"""Commands about this machine: its keys and its speed."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from outrider.commands.options import AsJson


def key(file: Annotated[Path, typer.Argument(help="New; only you may read it.")]) -> None:
    """Create a key with which vehicles and their commanders sign their messages (docs/signing.md)."""
    from outrider.key_files import new_key

    sys.stdout.write(f"{new_key(file)}\n")


def bench(
    as_json: AsJson = False,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer rounds, no flight.")] = False,
    compare: Annotated[
        Path | None, typer.Option(help="Output of an earlier bench --json: show the ratio of each figure.")
    ] = None,
) -> None:
    """Measure this machine: plan step, PIQP, physics, codec, tlog, real-time factor (CPU time)."""
    from outrider.bench.command import measure
    from outrider.bench.comparison import earlier, ratios
    from outrider.simulation.console import show_bench, show_ratios
    from outrider.terminal.share_progress import share_progress

    before = None if compare is None else earlier(compare)
    with share_progress() as watch:
        figures = measure(watch, quick=quick)
    found = [] if before is None else ratios(before, figures)
    if as_json:
        compared = {} if before is None else {"compared": {one.name: round(one.ratio, 3) for one in found}}
        sys.stdout.write(json.dumps(figures | compared) + "\n")
        return
    show_bench(figures)
    if before is not None:
        show_ratios([(one.name, one.before, one.now, one.ratio) for one in found])
