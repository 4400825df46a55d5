"""Findings of the check about one vehicle, about its links, and about the fleet; values only."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from outrider.scenarios.fleet_file import FleetFile


class Result(Enum):
    """Result of one check."""

    PASS = "pass"
    NOTE = "note"
    """For information: a certified flight is possible."""
    FAIL = "fail"


class Check(NamedTuple):
    """Check of ``subject`` (``vehicle 1``, ``2 → 1``, ``fleet``): what was found."""

    subject: str
    name: str
    result: Result
    text: str


class Verdict(NamedTuple):
    """All checks; ``fleet``: the fleet file, None if a check failed."""

    checks: tuple[Check, ...]
    fleet: FleetFile | None

    @property
    def passed(self) -> bool:
        """Whether a certified flight is possible."""
        return self.fleet is not None
