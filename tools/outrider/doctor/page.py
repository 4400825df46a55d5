"""A verdict for people, and as JSON."""

from __future__ import annotations

from typing import Any, Final

from rich.console import Console
from rich.table import Table
from rich.text import Text

from outrider.doctor.finding import Severity, Verdict

_STYLES: Final = {
    Severity.BLOCKING: "bold red",
    Severity.WARNING: "yellow",
    Severity.NOTE: "cyan",
    Severity.OK: "green",
}


def show(name: str, verdict: Verdict) -> None:
    """On standard output: the verdict in one line, then the findings, the worst first. Of what is well only
    that it is there."""
    console = Console(highlight=False)
    told = [(severity, len(verdict.of(severity))) for severity in reversed(Severity)]
    counts = ", ".join(f"{count} {severity.value}" for severity, count in told if count)
    ready = "ready for an escort" if verdict.ready else "NOT ready for an escort"
    # Not wrapped: how long the name is must not decide where a line breaks that scripts look for.
    console.print(Text(f"{name}: {ready} ({counts})", style="bold"), soft_wrap=True)
    table = Table.grid(padding=(0, 2))
    for what, severity, why, do in verdict.findings:
        lines = [what]
        if severity is not Severity.OK:
            lines.append(why)
        if do:
            lines.append(f"→ {do}")
        words = "\n".join(_plain(line) for line in lines)
        table.add_row(Text(severity.value, style=_STYLES[severity]), Text(words))
    console.print(table)


def document(verdict: Verdict) -> dict[str, Any]:
    """Values of JSON."""
    findings = [
        {"what": what, "severity": severity.value, "why": why, "do": do}
        for what, severity, why, do in verdict.findings
    ]
    return {"ready": verdict.ready, "findings": findings}


def _plain(text: str) -> str:
    """Without what would steer a terminal: vehicles' own words are in it."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
