"""Output of a verdict as a table and as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.table import Table
from rich.text import Text

from outrider.preflight.findings import Result, Verdict
from outrider.scenarios.fleet_file import text_of

_STYLES: Final = {Result.FAIL: "bold red", Result.NOTE: "cyan", Result.PASS: "green"}


def show(verdict: Verdict, written: Path | None, *, dry: bool = False) -> None:
    """Print all checks, then whether the fleet passes; ``written``: the fleet file.

    In a ``dry`` run print what the file would contain.
    """
    console = Console(highlight=False)
    table = Table.grid(padding=(0, 2))
    for subject, name, result, text in verdict.checks:
        words = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
        table.add_row(Text(result.value, style=_STYLES[result]), Text(subject), Text(name), Text(words))
    console.print(table)
    if verdict.fleet is None:
        failed = sum(check.result is Result.FAIL for check in verdict.checks)
        line = f"NOT ready for a certified flight: {failed} checks fail; no fleet file"
    elif dry:
        console.print(Text(text_of(verdict.fleet)), soft_wrap=True, end="")
        line = f"dry run: nothing written; fingerprint {verdict.fleet.fingerprint}"
    else:
        line = f"ready for a certified flight: {written}, fingerprint {verdict.fleet.fingerprint}"
    # Not wrapped: scripts search for it.
    console.print(Text(line, style="bold"), soft_wrap=True)


def document(verdict: Verdict, written: Path | None) -> dict[str, Any]:
    """Return the verdict as JSON values."""
    checks = [
        {"subject": subject, "name": name, "result": result.value, "text": text}
        for subject, name, result, text in verdict.checks
    ]
    fleet = None if verdict.fleet is None else verdict.fleet.model_dump(mode="json")
    return {
        "ready": verdict.passed,
        "checks": checks,
        "file": None if written is None else str(written),
        "fleet": fleet,
    }
