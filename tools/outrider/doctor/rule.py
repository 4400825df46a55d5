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
        return Meaning(OK, "It is the id that it speaks with.")
    return Meaning(
        WARNING,
        f"It still speaks as system {here}: it will be {value:g} after the next start.",
        "Restart it.",
    )


def fence(value: float, _case: Case) -> Meaning:
    """Judge GF_ACTION and FENCE_ENABLE."""
    if value == 0:
        return Meaning(
            NOTE,
            "Nothing but the companion's own limits keeps it in.",
            "A fence a little wider than those is a second line.",
        )
    return Meaning(
        NOTE, "What breaks the fence ends the escort.", "See that the escort's limits lie inside it."
    )


def low_battery(value: float, _case: Case) -> Meaning:
    """Judge COM_LOW_BAT_ACT and BATT_FS_LOW_ACT."""
    if value == 0:
        return Meaning(NOTE, "A low battery is only told, nothing is done: the companion alone sees to it.")
    return Meaning(OK, "On a low battery it lands or returns.")
