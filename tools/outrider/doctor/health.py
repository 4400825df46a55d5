"""Whether it may be armed and knows where it is: pre-arm check, sensors, estimator, GPS, battery."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pymavlink.dialects.v20 import all as dialect

from companion.vehicle import PREARM_OK
from mavlink_bridge.messages import BatteryStatus, EkfStatus, EstimatorStatus, GpsRaw, StatusText, SysStatus
from outrider.doctor.case import Case
from outrider.doctor.condition import Condition
from outrider.doctor.finding import Finding, Severity

_PREFIX: Final = "MAV_SYS_STATUS_"
_SENSORS: Final = {
    number: entry.name.removeprefix(_PREFIX).removeprefix("SENSOR_").lower().replace("_", " ")
    for number, entry in dialect.enums["MAV_SYS_STATUS_SENSOR"].items()
    if entry.name.startswith(_PREFIX) and number != PREARM_OK
}
_RC: Final = 0x10000
"""MAV_SYS_STATUS_SENSOR_RC_RECEIVER: an escort needs none."""
_CONSTANT_POSITION, _UNINITIALISED = 0x80, 0x400
_LOW, _EMPTY = 0.3, 0.15
_BRIEF: Final = 1.0
"""s."""
_POOR_HDOP, _POOR_ACCURACY = 2.0, 2.5


def checks(case: Case) -> Iterator[Finding]:
    """What SYS_STATUS says of arming and sensors."""
    status = case.vehicle.latest(SysStatus)
    if status is None:
        return
    if case.vehicle.vehicle.healthy:
        yield Finding(
            "the pre-arm check has passed", Severity.OK, f"It may be armed.{_spells(case.vehicle.armable)}"
        )
    elif not case.vehicle.tells_checks and not case.px4:
        yield Finding(
            "SYS_STATUS does not tell whether it may be armed",
            Severity.BLOCKING,
            "A companion waits for the pre-arm bit (health 0x10000000) before it arms, here for ever.",
            "Update the firmware (ArduCopter 4.0 and later tell it).",
        )
    else:
        said = _complaints(case)
        yield Finding(
            "the pre-arm check fails (SYS_STATUS, health 0x10000000)",
            Severity.BLOCKING,
            "The autopilot will refuse to arm." + (f" It said: {'; '.join(said)}." if said else ""),
            "Mend what it said."
            if said
            else "Its STATUSTEXTs say why (PreArm: … every 30 s; PX4: commander check).",
        )
    wrong = status.present & status.enabled & ~status.health & ~PREARM_OK
    names = [name for bit, name in _SENSORS.items() if wrong & bit]
    if names:
        yield Finding(
            f"unhealthy: {', '.join(names)}",
            Severity.NOTE if wrong == _RC else Severity.WARNING,
            "An escort needs no remote control, but a pilot does."
            if wrong == _RC
            else "It says so itself (SYS_STATUS).",
            "Look at the sensor, calibrate it, or see what its driver says in a ground station.",
        )


def _complaints(case: Case) -> list[str]:
    """What it lately said against arming, each once."""
    texts: list[StatusText] = [text for _, text in case.vehicle.texts]
    against = [
        text.text
        for text in texts
        if text.text.lower().startswith(("prearm", "preflight", "arming denied", "arm:"))
    ]
    return list(dict.fromkeys(against))[-4:]


def estimator(case: Case) -> Iterator[Finding]:
    """EKF_STATUS_REPORT of ArduPilot, ESTIMATOR_STATUS of PX4."""
    told: EkfStatus | EstimatorStatus | None
    told = case.vehicle.latest(EstimatorStatus) if case.px4 else case.vehicle.latest(EkfStatus)
    if told is None:
        name = "ESTIMATOR_STATUS" if case.px4 else "EKF_STATUS_REPORT"
        yield Finding(
            f"the estimator's state is not told ({name})",
            Severity.NOTE,
            "Whether it has an absolute position shows only in the pre-arm check.",
            "Nobody asked for it in this log." if case.log else f"Ask for {name} if you want to watch it.",
        )
        return
    if told.flags & 0x10 and not told.flags & _UNINITIALISED:
        yield Finding(
            "the estimator has an absolute position",
            Severity.OK,
            f"Set-points in local NED mean a place on the globe.{_spells(case.vehicle.located)}",
        )
        return
    if not case.px4 and told.flags & _CONSTANT_POSITION:
        why = "It assumes that it does not move at all (constant position)."
    elif told.flags & 0x8:
        why = "It knows only how it moved (optical flow, dead reckoning), not where on the globe it is."
    else:
        why = "It has no position."
    yield Finding(
        "the estimator has no absolute position",
        Severity.BLOCKING,
        f"{why} Others could not be kept away from it.",
        "Wait for GPS with open sky, half a minute after boot and more; if it stays so, see "
        "EK3_SRC1_POSXY and AHRS_EKF_TYPE."
        if not case.px4
        else "Wait for GPS with open sky; if it stays so, see EKF2_GPS_CTRL and EKF2_GPS_CHECK.",
    )


def gps(case: Case) -> Iterator[Finding]:
    """GPS_RAW_INT."""
    told = case.vehicle.latest(GpsRaw)
    if told is None:
        yield Finding(
            "GPS is not told (GPS_RAW_INT)",
            Severity.NOTE,
            "How good positions are is not known.",
            "" if case.log else "Ask for it, if you want to know how far apart vehicles must stay.",
        )
        return
    satellites = "" if told.satellites is None else f", {told.satellites} satellites"
    if told.fix_type < 3:
        yield Finding(
            f"GPS: no fix in three dimensions{satellites}",
            Severity.BLOCKING,
            f"Neither target nor neighbours can be related to this vehicle.{_spells(case.vehicle.fixed)}",
            "Open sky, time, or a look at the receiver (GPS1_TYPE; GPS_1_CONFIG with PX4).",
        )
        return
    words = {3: "3D fix", 4: "DGPS", 5: "RTK float", 6: "RTK fixed"}
    what = f"GPS: {words.get(told.fix_type, f'fix {told.fix_type}')}{satellites}"
    poor = (told.hdop is not None and told.hdop > _POOR_HDOP) or told.horizontal_accuracy > _POOR_ACCURACY
    if poor:
        yield Finding(
            f"{what}, poor",
            Severity.WARNING,
            f"HDOP {told.hdop or 0:.1f}, accuracy {told.horizontal_accuracy:.1f} m: neighbours may be "
            "nearer than they say.",
            "Wait for more satellites, or keep wider distances (position_sigma).",
        )
    elif told.fix_type >= 5:
        yield Finding(what, Severity.OK, f"Good to centimetres or decimetres.{_spells(case.vehicle.fixed)}")
    else:
        yield Finding(
            what,
            Severity.OK,
            "Good to a metre or two; the distances kept must allow for that "
            f"(position_sigma).{_spells(case.vehicle.fixed)}",
        )


def battery(case: Case) -> Iterator[Finding]:
    """SYS_STATUS and BATTERY_STATUS, against what the autopilot itself calls low."""
    status, told = case.vehicle.latest(SysStatus), case.vehicle.latest(BatteryStatus)
    remaining = told.remaining if told is not None else None
    voltage = status.battery_voltage if status is not None else None
    if remaining is None and status is not None:
        remaining = status.battery_remaining
    low_voltage = case.parameter("BATT_LOW_VOLT") or 0.0
    empty = max(case.parameter("BAT_LOW_THR") or 0.0, _EMPTY)
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
    elif remaining <= _LOW:
        yield Finding(
            f"battery: {remaining:.0%}{volts}",
            Severity.WARNING,
            "It will not last long.",
            "Charge it before an escort.",
        )
    else:
        yield Finding(f"battery: {remaining:.0%}{volts}", Severity.OK, "Enough to begin with.")


def _spells(condition: Condition) -> str:
    """What of it was not so before."""
    if condition.missing < _BRIEF:
        return ""
    times = f", and it was lost {condition.lost} times" if condition.lost > 1 else ", and it was lost once"
    return f" For {condition.missing:.0f} s it was not so{times if condition.lost else ', to begin with'}."
