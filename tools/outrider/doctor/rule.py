"""Meaning of a parameter for an escort, and rules that both firmwares share."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from outrider.doctor.case import Case
from outrider.doctor.finding import Severity


class Meaning(NamedTuple):
    """Meaning of a value."""

    severity: Severity
    why: str
    do: str = ""


class Rule(NamedTuple):
    """Rule for one parameter; ``unknown``: what to consider while it was not received."""

    name: str
    judge: Callable[[float, Case], Meaning]
    unknown: str


OK, NOTE, WARNING, BLOCKING = Severity.OK, Severity.NOTE, Severity.WARNING, Severity.BLOCKING


def number(value: float, case: Case) -> Meaning:
    """Judge MAV_SYS_ID and SYSID_THISMAV."""
    here = case.vehicle.source.system
    if value == here:
        return Meaning(OK, "The vehicle sends with this id.")
    return Meaning(
        WARNING,
        f"It still sends as system {here}; the id becomes {value:g} at the next start.",
        "Restart it.",
    )


def fence(value: float, _case: Case) -> Meaning:
    """Judge GF_ACTION and FENCE_ENABLE."""
    if value == 0:
        return Meaning(
            NOTE,
            "Only the companion's own limits confine it.",
            "A fence slightly wider than these limits is a second protection.",
        )
    return Meaning(
        NOTE, "A breach of the fence ends the escort.", "See that the escort's limits lie inside it."
    )


def low_battery(value: float, _case: Case) -> Meaning:
    """Judge COM_LOW_BAT_ACT and BATT_FS_LOW_ACT."""
    if value == 0:
        return Meaning(NOTE, "A low battery is only reported; only the companion reacts.")
    return Meaning(OK, "On a low battery it lands or returns.")
