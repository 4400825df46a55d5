"""What a doctor says: values only."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class Severity(Enum):
    """How much it matters to an escort."""

    OK = "ok"
    NOTE = "note"
    """To be known; nothing is wrong with it."""
    WARNING = "warning"
    """It flies, and something can go badly."""
    BLOCKING = "blocking"
    """It does not fly, or must not."""


class Finding(NamedTuple):
    """``what`` is there, ``why`` that matters to an escort, what to ``do`` about it (empty: nothing)."""

    what: str
    severity: Severity
    why: str
    do: str = ""


class Verdict(NamedTuple):
    """All findings, the worst first."""

    findings: tuple[Finding, ...]

    @property
    def ready(self) -> bool:
        """Whether nothing blocks an escort."""
        return all(finding.severity is not Severity.BLOCKING for finding in self.findings)

    def of(self, severity: Severity) -> tuple[Finding, ...]:
        """Those that matter so much."""
        return tuple(finding for finding in self.findings if finding.severity is severity)
