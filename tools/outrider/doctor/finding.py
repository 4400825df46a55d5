"""Findings of the doctor; values only."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class Severity(Enum):
    """Severity for an escort."""

    OK = "ok"
    NOTE = "note"
    """For information; nothing is wrong."""
    WARNING = "warning"
    """The vehicle flies, but something can go badly."""
    BLOCKING = "blocking"
    """The vehicle does not fly, or must not."""


class Finding(NamedTuple):
    """One finding: ``what`` was found, ``why`` it matters to an escort, what to ``do`` (empty: nothing)."""

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
        """Return the findings of that severity."""
        return tuple(finding for finding in self.findings if finding.severity is severity)
