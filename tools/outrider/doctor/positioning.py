"""Position estimate of the vehicle: estimator and GPS."""

from __future__ import annotations

from collections.abc import Iterator

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import EkfStatus, EstimatorStatus, GpsRaw
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity

_POOR_HDOP, _POOR_ACCURACY = 2.0, 2.5


def estimator(case: Case) -> Iterator[Finding]:
    """Yield findings from ArduPilot's EKF_STATUS_REPORT or PX4's ESTIMATOR_STATUS: flag bits 0 to 9 agree."""
    reported: EkfStatus | EstimatorStatus | None
    reported = case.vehicle.latest(EstimatorStatus) if case.px4 else case.vehicle.latest(EkfStatus)
    if reported is None:
        name = "ESTIMATOR_STATUS" if case.px4 else "EKF_STATUS_REPORT"
        yield Finding(
            f"the estimator's state is not told ({name})",
            Severity.NOTE,
            "Whether it has an absolute position shows only in the pre-arm check.",
            "Nobody asked for it in this log." if case.log else "It was asked for and did not come.",
        )
        return
    # The same bit means a GPS glitch in PX4's ESTIMATOR_STATUS.
    waits = not case.px4 and reported.flags & mavlink.EKF_UNINITIALIZED
    if reported.flags & mavlink.ESTIMATOR_POS_HORIZ_ABS and not waits:
        yield Finding(
            "the estimator has an absolute position",
            Severity.OK,
            f"Set-points in local NED mean a place on the globe.{case.vehicle.located.history}",
        )
        return
    if not case.px4 and reported.flags & mavlink.EKF_CONST_POS_MODE:
        why = "It assumes that it does not move at all (constant position)."
    elif reported.flags & mavlink.ESTIMATOR_POS_HORIZ_REL:
        why = "It has only a relative position (optical flow, dead reckoning), not one on the globe."
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
    """Yield findings from GPS_RAW_INT."""
    fix = case.vehicle.latest(GpsRaw)
    if fix is None:
        yield Finding(
            "GPS is not reported (GPS_RAW_INT)",
            Severity.NOTE,
            "The accuracy of the positions is unknown.",
            "" if case.log else "It was asked for and did not come.",
        )
        return
    satellites = "" if fix.satellites is None else f", {fix.satellites} satellites"
    if fix.fix_type < mavlink.GPS_FIX_TYPE_3D_FIX:
        yield Finding(
            f"GPS: no fix in three dimensions{satellites}",
            Severity.BLOCKING,
            f"Neither target nor neighbours can be related to this vehicle.{case.vehicle.fixed.history}",
            "Open sky, time, or a look at the receiver (GPS1_TYPE; GPS_1_CONFIG with PX4).",
        )
        return
    words = {
        mavlink.GPS_FIX_TYPE_3D_FIX: "3D fix",
        mavlink.GPS_FIX_TYPE_DGPS: "DGPS",
        mavlink.GPS_FIX_TYPE_RTK_FLOAT: "RTK float",
        mavlink.GPS_FIX_TYPE_RTK_FIXED: "RTK fixed",
    }
    what = f"GPS: {words.get(fix.fix_type, f'fix {fix.fix_type}')}{satellites}"
    poor = (fix.hdop is not None and fix.hdop > _POOR_HDOP) or fix.horizontal_accuracy > _POOR_ACCURACY
    if poor:
        yield Finding(
            f"{what}, poor",
            Severity.WARNING,
            f"HDOP {fix.hdop or 0:.1f}, accuracy {fix.horizontal_accuracy:.1f} m: neighbours may be "
            "nearer than they say.",
            "Wait for more satellites, or keep wider distances (position_sigma).",
        )
    elif fix.fix_type >= mavlink.GPS_FIX_TYPE_RTK_FLOAT:
        yield Finding(what, Severity.OK, f"Good to centimetres or decimetres.{case.vehicle.fixed.history}")
    else:
        yield Finding(
            what,
            Severity.OK,
            "Good to a metre or two; the distances kept must allow for that "
            f"(position_sigma).{case.vehicle.fixed.history}",
        )
