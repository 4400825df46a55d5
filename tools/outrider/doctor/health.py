"""Readiness for arming: pre-arm check, sensors, battery."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import BatteryStatus, SysStatus
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity

_PREFIX: Final = "MAV_SYS_STATUS_"
_SENSORS: Final = {
    number: entry.name.removeprefix(_PREFIX).removeprefix("SENSOR_").lower().replace("_", " ")
    for number, entry in mavlink.enums["MAV_SYS_STATUS_SENSOR"].items()
    if entry.name.startswith(_PREFIX) and number != mavlink.MAV_SYS_STATUS_PREARM_CHECK
}
_LOW_CHARGE, _EMPTY_CHARGE = 0.3, 0.15


def checks(case: Case) -> Iterator[Finding]:
    """Yield findings from SYS_STATUS on arming and sensors."""
    status = case.vehicle.latest(SysStatus)
    if status is None:
        return
    if case.vehicle.vehicle.healthy:
        yield Finding(
            "the pre-arm check has passed", Severity.OK, f"It may be armed.{case.vehicle.armable.history}"
        )
    elif not case.vehicle.tells_checks and not case.px4:
        yield Finding(
            "SYS_STATUS does not tell whether it may be armed",
            Severity.BLOCKING,
            "A companion waits for the pre-arm bit (health 0x10000000) before it arms, here for ever.",
            "Update the firmware (ArduCopter 4.0 and later tell it).",
        )
    else:
        yield _failing(case)
    wrong = status.present & status.enabled & ~status.health & ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
    names = [name for bit, name in _SENSORS.items() if wrong & bit]
    if names:
        yield Finding(
            f"unhealthy: {', '.join(names)}",
            Severity.NOTE if wrong == mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER else Severity.WARNING,
            "An escort needs no remote control, but a pilot does."
            if wrong == mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
            else "It says so itself (SYS_STATUS).",
            "Look at the sensor, calibrate it, or see what its driver says in a ground station.",
        )


def _failing(case: Case) -> Finding:
    """Return the finding on a failing pre-arm check, with the reasons received so far."""
    what, why = "the pre-arm check fails (SYS_STATUS, health 0x10000000)", "The autopilot will refuse to arm."
    said = case.vehicle.objections
    if said:
        return Finding(what, Severity.BLOCKING, f"{why} It said: {'; '.join(said)}.", "Mend what it said.")
    if case.log:
        do = "Its STATUSTEXTs say why (PreArm: … every 30 s); this log has none."
    elif case.vehicle.vehicle.armed:
        do = "Land and disarm it, then ask again."
    elif case.px4:
        why += " It was asked for the reasons and named none that is known here."
        do = "See the arming checks in QGroundControl: PX4 sends texts only where it hears a ground station."
    else:
        why += " It was asked for the reasons, and named none."
        do = "See its messages in a ground station; ARMING_OPTIONS with bit 0 hides them."
    return Finding(what, Severity.BLOCKING, why, do)


def battery(case: Case) -> Iterator[Finding]:
    """Yield a finding from SYS_STATUS and BATTERY_STATUS.

    A voltage below BATT_LOW_VOLT blocks an escort, and so does a charge up to the greater of BAT_LOW_THR and
    15 %. A charge up to 30 % is a warning.
    """
    status, reported = case.vehicle.latest(SysStatus), case.vehicle.latest(BatteryStatus)
    remaining = reported.remaining if reported is not None else None
    voltage = status.battery_voltage if status is not None else None
    if remaining is None and status is not None:
        remaining = status.battery_remaining
    low_voltage = case.parameter("BATT_LOW_VOLT") or 0.0
    empty = max(case.parameter("BAT_LOW_THR") or 0.0, _EMPTY_CHARGE)
    volts = f", {voltage:.1f} V" if voltage else ""
    if voltage and voltage < low_voltage:
        yield Finding(
            f"battery: {voltage:.1f} V, below BATT_LOW_VOLT ({low_voltage:.1f} V)",
            Severity.BLOCKING,
            "Its failsafe lands or returns it in the middle of an escort.",
            "Put a charged battery in.",
        )
    elif remaining is None:
        yield Finding(
            f"the battery's charge is not told{volts}",
            Severity.NOTE,
            "An escort cannot see in time that it has to go home.",
            "Set BATT_MONITOR and BATT_CAPACITY (BAT1_SOURCE, BAT1_N_CELLS and BAT1_CAPACITY with PX4).",
        )
    elif remaining <= empty:
        yield Finding(
            f"battery: {remaining:.0%}{volts}",
            Severity.BLOCKING,
            f"That is what the autopilot takes for low ({empty:.0%}): its failsafe is next.",
            "Put a charged battery in.",
        )
    elif remaining <= _LOW_CHARGE:
        yield Finding(
            f"battery: {remaining:.0%}{volts}",
            Severity.WARNING,
            "It will not last long.",
            "Charge it before an escort.",
        )
    else:
        yield Finding(f"battery: {remaining:.0%}{volts}", Severity.OK, "Enough to begin with.")
