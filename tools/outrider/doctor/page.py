"""A verdict for people, and as JSON."""

from __future__ import annotations

from typing import Any, Final

from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from outrider.doctor.finding import Severity, Verdict

_STYLES: Final = {
    Severity.BLOCKING: "bold red",
    Severity.WARNING: "yellow",
    Severity.NOTE: "cyan",
    Severity.OK: "green",
}
_WIDEST: Final = max(len(severity.value) for severity in Severity)
_INDENT: Final = (0, 0, 0, _WIDEST + 2)


def show(name: str, verdict: Verdict) -> None:
    """On standard output: the verdict in one line, then the findings, the worst first. Of what is well only
    that it is there."""
    console = Console(highlight=False)
    told = [(severity, len(verdict.of(severity))) for severity in reversed(Severity)]
    counts = ", ".join(f"{count} {severity.value}" for severity, count in told if count)
    ready = "ready for an escort" if verdict.ready else "NOT ready for an escort"
    console.print(Text(f"{name}: {ready} ({counts})", style="bold"))
    for what, severity, why, do in verdict.findings:
        line = Text(f"{severity.value:{_WIDEST}}  ", style=_STYLES[severity])
        console.print(line.append(_plain(what), style="default"))
        if severity is not Severity.OK:
            console.print(Padding(Text(_plain(why)), _INDENT))
        if do:
            console.print(Padding(Text(f"→ {_plain(do)}"), _INDENT))


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
