"""The parameters that decide what becomes of an escort."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity


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


def _loss_action(value: float, _case: Case) -> Said:
    said = {
        0: Said(
            WARNING,
            "When set-points stop it changes to Position mode and, without a pilot, sinks at 0.6 m/s: "
            "its default.",
            "Set COM_OBL_RC_ACT to 5 (hold).",
        ),
        3: Said(
            NOTE,
            "When set-points stop it returns home, across whatever is between.",
            "5 (hold) keeps it clear of others.",
        ),
        4: Said(NOTE, "When set-points stop it lands where it is.", "5 (hold) keeps it clear of others."),
        5: Said(OK, "When set-points stop it holds, after 3 to 4 m of drift from 2 m/s."),
    }
    if value in said:
        return said[int(value)]
    if value in (1, 2):
        return Said(
            WARNING, "When set-points stop it goes to a mode that a pilot has to fly.", "Set it to 5 (hold)."
        )
    return Said(BLOCKING, "When set-points stop it stops its motors in the air.", "Set it to 5 (hold).")


def _loss_time(value: float, _case: Case) -> Said:
    if value < 0.3:
        return Said(WARNING, "A short break of the link ends OFFBOARD.", "Set COM_OF_LOSS_T to 1 s.")
    if value > 2.0:
        return Said(
            WARNING, f"For {value:g} s it keeps on going as last told, blind.", "Set COM_OF_LOSS_T to 1 s."
        )
    return Said(OK, f"OFFBOARD ends {value:g} s after the last set-point.")


def _remote_lost(value: float, _case: Case) -> Said:
    if int(value) & 4:
        return Said(OK, "OFFBOARD goes on without remote control.")
    return Said(
        NOTE,
        "Once a remote control was there and is lost, NAV_RCL_ACT ends OFFBOARD.",
        "COM_RCL_EXCEPT with bit 2 (value 4) keeps OFFBOARD; leave it if a pilot stands by.",
    )


def _ground_lost(value: float, _case: Case) -> Said:
    if value == 0:
        return Said(NOTE, "It flies on when the ground station is lost: the companion alone sees to it.")
    return Said(
        NOTE,
        "When the ground station is lost the autopilot acts by itself (hold 1, return 2, land 3, …).",
        "See that a ground station stays connected, or set NAV_DLL_ACT to 0.",
    )


def _number(value: float, case: Case) -> Said:
    here = case.vehicle.source.system
    if value == here:
        return Said(OK, "It is the id that it speaks with.")
    return Said(
        WARNING,
        f"It still speaks as system {here}: it will be {value:g} after the next start.",
        "Restart it.",
    )


def _failures(value: float, _case: Case) -> Said:
    if value == 0:
        return Said(OK, "Nobody can make its sensors or motors fail by a command.")
    return Said(
        WARNING, "A command can make its sensors and motors fail, as tests do.", "Set SYS_FAILURE_EN to 0."
    )


def _guided_timeout(value: float, _case: Case) -> Said:
    if value > 3.0:
        return Said(
            WARNING,
            f"When set-points stop it flies on as last told for {value:g} s.",
            "Set GUID_TIMEOUT to 3 s or less.",
        )
    if value < 0.3:
        return Said(WARNING, "A short break of the link makes it brake.", "Set GUID_TIMEOUT to 1 s.")
    return Said(
        OK,
        f"When set-points stop it flies on as last told for {value:g} s, then brakes (3 s: about 8 m from "
        "2 m/s).",
    )


def _ground_failsafe(value: float, case: Case) -> Said:
    if value == 0:
        return Said(NOTE, "It flies on when the ground station is lost: the companion alone sees to it.")
    station = case.parameter("SYSID_MYGCS")
    there = {one.source.system for one in case.hearing.speakers.values() if one.is_ground_station}
    if station is None or station in there:
        return Said(
            NOTE,
            "When the ground station's HEARTBEAT is lost it returns or lands, escort or not.",
            "Keep that station on.",
        )
    seen = ", ".join(map(str, sorted(there))) or "none"
    return Said(
        WARNING,
        f"It watches for ground station {station:g} (SYSID_MYGCS), and here is {seen}: once seen and "
        "lost, it returns or lands.",
        "Give the ground station that id, set SYSID_MYGCS to its own, or FS_GCS_ENABLE to 0.",
    )


def _station(value: float, case: Case) -> Said:
    if value == case.vehicle.source.system:
        return Said(WARNING, "It takes itself for its ground station.", "Set SYSID_MYGCS to 255.")
    return Said(
        OK,
        "Whose HEARTBEAT FS_GCS_ENABLE watches. A companion speaks with the vehicle's own id and never "
        "counts as it.",
    )


def _arming(value: float, _case: Case) -> Said:
    if value == 0:
        return Said(WARNING, "It arms without any check.", "Set ARMING_CHECK to 1.")
    return Said(
        OK if int(value) & 1 else NOTE,
        "It checks itself before it arms." if int(value) & 1 else "Some checks are left out.",
    )


def _estimator_failsafe(value: float, _case: Case) -> Said:
    if value == 0:
        return Said(WARNING, "It flies on when its estimator fails.", "Set FS_EKF_ACTION to 1 (land).")
    return Said(OK, "It lands, or holds its height, when its estimator fails.")


def _fence(value: float, _case: Case) -> Said:
    if value == 0:
        return Said(
            NOTE,
            "Nothing but the companion's own limits keeps it in.",
            "A fence a little wider than those is a second line.",
        )
    return Said(NOTE, "What breaks the fence ends the escort.", "See that the escort's limits lie inside it.")


def _low_battery(value: float, _case: Case) -> Said:
    if value == 0:
        return Said(NOTE, "A low battery is only told, nothing is done: the companion alone sees to it.")
    return Said(OK, "On a low battery it lands or returns.")


_PX4: Final = (
    Rule("COM_OBL_RC_ACT", _loss_action, "Its default, 0, sinks at 0.6 m/s when set-points stop; 5 holds."),
    Rule("COM_OF_LOSS_T", _loss_time, "How long it follows after the last set-point: 1 s by default."),
    Rule("COM_RCL_EXCEPT", _remote_lost, "Whether losing the remote control ends OFFBOARD."),
    Rule("NAV_DLL_ACT", _ground_lost, "What it does when the ground station is lost."),
    Rule("COM_LOW_BAT_ACT", _low_battery, "What it does when the battery is low."),
    Rule("GF_ACTION", _fence, "What it does at its fence."),
    Rule("SYS_FAILURE_EN", _failures, "Whether failures can be injected."),
    Rule("MAV_SYS_ID", _number, "Its id after the next start."),
)
_ARDUPILOT: Final = (
    Rule("GUID_TIMEOUT", _guided_timeout, "How long it flies on when set-points stop: 3 s by default."),
    Rule("FS_GCS_ENABLE", _ground_failsafe, "What it does when the ground station is lost."),
    Rule("SYSID_MYGCS", _station, "Whose HEARTBEAT counts as the ground station's: 255 by default."),
    Rule("FS_EKF_ACTION", _estimator_failsafe, "What it does when its estimator fails."),
    Rule("ARMING_CHECK", _arming, "Whether it checks itself before it arms."),
    Rule("FENCE_ENABLE", _fence, "Whether a fence holds it in."),
    Rule("BATT_FS_LOW_ACT", _low_battery, "What it does when the battery is low."),
    Rule("SYSID_THISMAV", _number, "Its id after the next start."),
)
_ALSO: Final = {True: ("BAT_LOW_THR",), False: ("BATT_LOW_VOLT",)}
"""What other checks want to know, by whether it is PX4."""
_URGENT: Final = frozenset(("COM_OBL_RC_ACT", "GUID_TIMEOUT"))


def rules(*, px4: bool) -> tuple[Rule, ...]:
    """Those of a firmware."""
    return _PX4 if px4 else _ARDUPILOT


def names(*, px4: bool) -> tuple[str, ...]:
    """Which parameters to ask for."""
    return tuple(rule.name for rule in rules(px4=px4)) + _ALSO[px4]


def settings(case: Case) -> Iterator[Finding]:
    """A finding for each that was told, and one for those that were not."""
    if case.profile is None:
        return
    untold = []
    for rule in rules(px4=case.px4):
        value = case.parameter(rule.name)
        if value is None:
            untold.append(rule)
        else:
            severity, why, do = rule.judge(value, case)
            yield Finding(f"{rule.name} = {value:g}", severity, why, do)
    urgent = [rule for rule in untold if rule.name in _URGENT]
    for rule in urgent:
        yield Finding(
            f"{rule.name} is not {'in the log' if case.log else 'told'}",
            Severity.WARNING if case.px4 else Severity.NOTE,
            rule.unknown,
            f"Read it (param show {rule.name}), and set it to 5."
            if case.px4
            else f"Read it (param show {rule.name}).",
        )
    others = [rule.name for rule in untold if rule not in urgent]
    if others:
        yield Finding(
            f"not {'in the log' if case.log else 'told'}: {', '.join(others)}",
            Severity.NOTE,
            "What the autopilot does when something is lost is not known from here.",
            "Have the ground station load all parameters while it records."
            if case.log
            else "Read them in a ground station.",
        )
