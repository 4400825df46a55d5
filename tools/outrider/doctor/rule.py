"""What a parameter means to an escort, and what both firmwares have in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from outrider.doctor.case import Case
from outrider.doctor.finding import Severity


class Said(NamedTuple):
    """What a value means."""

    severity: Severity
    why: str
    do: str = ""


class Rule(NamedTuple):
    """One parameter; ``unknown``: what to be aware of while it was not told."""

    name: str
    judge: Callable[[float, Case], Said]
    unknown: str


OK, NOTE, WARNING, BLOCKING = Severity.OK, Severity.NOTE, Severity.WARNING, Severity.BLOCKING


def number(value: float, case: Case) -> Said:
    """MAV_SYS_ID and SYSID_THISMAV."""
    here = case.vehicle.source.system
    if value == here:
        return Said(OK, "It is the id that it speaks with.")
    return Said(
        WARNING,
        f"It still speaks as system {here}: it will be {value:g} after the next start.",
        "Restart it.",
    )


def fence(value: float, _case: Case) -> Said:
    """GF_ACTION and FENCE_ENABLE."""
    if value == 0:
        return Said(
            NOTE,
            "Nothing but the companion's own limits keeps it in.",
            "A fence a little wider than those is a second line.",
        )
    return Said(NOTE, "What breaks the fence ends the escort.", "See that the escort's limits lie inside it.")


def low_battery(value: float, _case: Case) -> Said:
    """COM_LOW_BAT_ACT and BATT_FS_LOW_ACT."""
    if value == 0:
        return Said(NOTE, "A low battery is only told, nothing is done: the companion alone sees to it.")
    return Said(OK, "On a low battery it lands or returns.")
