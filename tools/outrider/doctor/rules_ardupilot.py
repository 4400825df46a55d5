"""Rules for ArduCopter's parameters that affect an escort."""

from __future__ import annotations

from typing import Final

from outrider.doctor.case import Case
from outrider.doctor.rule import NOTE, OK, WARNING, Meaning, Rule, fence, low_battery, number

_BRIEF, _STOCK = 1.0, 3.0
"""GUID_TIMEOUT (s): the recommended value, and the firmware's default."""


def _guided_timeout(value: float, _case: Case) -> Meaning:
    if value < 0.3:
        return Meaning(WARNING, "A short break of the link makes it brake.", "Set GUID_TIMEOUT to 1 s.")
    flies_on = f"When set-points stop it follows the last one for {value:g} s, then brakes"
    if value <= _BRIEF:
        return Meaning(OK, f"{flies_on}.")
    saved = value - _BRIEF
    return Meaning(
        WARNING if value > _STOCK else NOTE,
        f"{flies_on}: with 3 s ArduCopter 4.6.3 settled 4.6 to 5.7 m off when both processes of fly were "
        f"killed. 1 s saves {saved:g} s of that, {2.0 * saved:g} m at 2 m/s, and others need less room "
        "around it (guard.flown_on_us).",
        "Set GUID_TIMEOUT to 1 s or less, not below 0.3, and guard.flown_on_us of all companions to the same "
        "when every vehicle has it.",
    )


def _ground_failsafe(value: float, case: Case) -> Meaning:
    if value == 0:
        return Meaning(NOTE, "It flies on when the ground station is lost.")
    station = case.parameter("SYSID_MYGCS")
    there = {one.source.system for one in case.hearing.senders.values() if one.is_ground_station}
    if station is None or station in there:
        return Meaning(
            NOTE,
            "When the ground station's HEARTBEAT is lost it returns or lands, escort or not.",
            "Keep that station on.",
        )
    seen = ", ".join(map(str, sorted(there))) or "none"
    return Meaning(
        WARNING,
        f"It watches for ground station {station:g} (SYSID_MYGCS); on this link: {seen}. If that station "
        "appears and is lost, the vehicle returns or lands.",
        "Give the ground station that id, set SYSID_MYGCS to its own, or FS_GCS_ENABLE to 0.",
    )


def _station(value: float, case: Case) -> Meaning:
    if value == case.vehicle.source.system:
        return Meaning(WARNING, "Its own id is the ground station's.", "Set SYSID_MYGCS to 255.")
    return Meaning(
        OK,
        "FS_GCS_ENABLE monitors the HEARTBEAT of this id. A companion sends with the vehicle's own id and "
        "never counts as the ground station.",
    )


def _arming(value: float, _case: Case) -> Meaning:
    if value == 0:
        return Meaning(WARNING, "It arms without any check.", "Set ARMING_CHECK to 1.")
    return Meaning(
        OK if int(value) & 1 else NOTE,
        "It checks itself before it arms." if int(value) & 1 else "Some checks are left out.",
    )


def _estimator_failsafe(value: float, _case: Case) -> Meaning:
    if value == 0:
        return Meaning(WARNING, "It flies on when its estimator fails.", "Set FS_EKF_ACTION to 1 (land).")
    return Meaning(OK, "It lands, or holds its height, when its estimator fails.")


ARDUPILOT_RULES: Final = (
    Rule("GUID_TIMEOUT", _guided_timeout, "How long it flies on when set-points stop: 3 s by default."),
    Rule("FS_GCS_ENABLE", _ground_failsafe, "What it does when the ground station is lost."),
    Rule("SYSID_MYGCS", _station, "Id of the ground station that FS_GCS_ENABLE monitors: 255 by default."),
    Rule("FS_EKF_ACTION", _estimator_failsafe, "What it does when its estimator fails."),
    Rule("ARMING_CHECK", _arming, "Whether it checks itself before it arms."),
    Rule("FENCE_ENABLE", fence, "Whether a fence confines it."),
    Rule("BATT_FS_LOW_ACT", low_battery, "What it does when the battery is low."),
    Rule("SYSID_THISMAV", number, "Its id after the next start."),
)
"""Rules in the order in which they are reported."""
