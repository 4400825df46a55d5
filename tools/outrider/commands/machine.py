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
) -> None:
    """Measure this machine: plan step, PIQP, physics, codec, tlog, real-time factor (CPU time)."""
    from outrider.bench.command import measure
    from outrider.simulation.console import show_bench
    from outrider.terminal.share_progress import share_progress

    with share_progress() as watch:
        figures = measure(watch, quick=quick)
    if as_json:
        sys.stdout.write(json.dumps(figures) + "\n")
    else:
        show_bench(figures)
