"""Check of the parameters that affect an escort."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilots.limits import stock_parameters
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity
from outrider.doctor.rule import Rule
from outrider.doctor.rules_ardupilot import ARDUPILOT_RULES
from outrider.doctor.rules_px4 import PX4_RULES

_OTHER_PARAMETERS: Final = {
    True: ("BAT_LOW_THR", *stock_parameters(mavlink.MAV_AUTOPILOT_PX4)),
    False: ("BATT_LOW_VOLT", *stock_parameters(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)),
}
"""Parameters that other checks need, by whether the autopilot is PX4."""
_URGENT: Final = frozenset(("COM_OBL_RC_ACT", "GUID_TIMEOUT"))


def rules(*, px4: bool) -> tuple[Rule, ...]:
    """Return the rules of a firmware."""
    return PX4_RULES if px4 else ARDUPILOT_RULES


def names(*, px4: bool) -> tuple[str, ...]:
    """Return the names of the parameters to request."""
    return tuple(rule.name for rule in rules(px4=px4)) + _OTHER_PARAMETERS[px4]


def settings(case: Case) -> Iterator[Finding]:
    """Yield one finding for each received or urgent parameter, and one for all others that are missing."""
    if case.profile is None:
        return
    unreported = []
    for rule in rules(px4=case.px4):
        value = case.parameter(rule.name)
        if value is None:
            unreported.append(rule)
        else:
            severity, why, do = rule.judge(value, case)
            yield Finding(f"{rule.name} = {value:g}", severity, why, do)
    urgent = [rule for rule in unreported if rule.name in _URGENT]
    for rule in urgent:
        yield Finding(
            f"{rule.name} is not {'in the log' if case.log else 'told'}",
            Severity.WARNING if case.px4 else Severity.NOTE,
            rule.unknown,
            f"Read it (param show {rule.name}), and set it to 5."
            if case.px4
            else f"Read it (param show {rule.name}).",
        )
    others = [rule.name for rule in unreported if rule not in urgent]
    if others:
        yield Finding(
            f"not {'in the log' if case.log else 'told'}: {', '.join(others)}",
            Severity.NOTE,
            "How the autopilot reacts to a loss of link, estimate or battery is unknown.",
            "Have the ground station load all parameters while it records."
            if case.log
            else "Read them in a ground station.",
        )
