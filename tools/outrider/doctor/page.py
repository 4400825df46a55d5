"""Output of a verdict as text and as JSON."""

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
    """Print the verdict in one line, then the findings, the worst first.

    For findings of severity OK the reason is omitted.
    """
    console = Console(highlight=False)
    reported = [(severity, len(verdict.of(severity))) for severity in reversed(Severity)]
    counts = ", ".join(f"{count} {_plural(severity, count)}" for severity, count in reported if count)
    ready = "ready for an escort" if verdict.ready else "NOT ready for an escort"
    # Not wrapped: the length of the name must not move line breaks within text that scripts search for.
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
    """Return the verdict as JSON values."""
    findings = [
        {"what": what, "severity": severity.value, "why": why, "do": do}
        for what, severity, why, do in verdict.findings
    ]
    return {"ready": verdict.ready, "findings": findings}


def _plain(text: str) -> str:
    """Replace unprintable characters: texts of vehicles could otherwise control the terminal."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


def _plural(severity: Severity, count: int) -> str:
    countable = severity in (Severity.WARNING, Severity.NOTE) and count > 1
    return severity.value + "s" * countable
