"""Origin of the local frame, home, and agreement of the vehicle's positions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from mavlink_bridge.frames import FleetFrame, ned_to_enu
from mavlink_bridge.messages import GlobalPosition, GpsGlobalOrigin, HomePosition
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity

_MAX_DISTANCE_M: Final = 3.0
"""Largest horizontal distance between local and global position of a vehicle at rest (m)."""
_MAX_HOME_DISTANCE_M: Final = 500.0
_MAX_REVERSED_SLOPE: Final = -0.5


def origin(case: Case) -> Iterator[Finding]:
    """Yield findings on GPS_GLOBAL_ORIGIN, to which every set-point is relative."""
    origins = case.vehicle.origins
    if len(origins) > 1:
        frame = _frame(origins[0])
        moved = max(float(np.linalg.norm(frame.to_enu(*one[1:4]))) for one in origins[1:])
        yield Finding(
            f"the origin has moved, by {moved:.1f} m",
            Severity.WARNING,
            "Local positions before and after differ by that; a companion that misses the change flies "
            "beside its goal.",
            "Do not set it in flight (SET_GPS_GLOBAL_ORIGIN), and begin with a good fix.",
        )
    if origins:
        last = origins[-1]
        if last.latitude == 0.0 and last.longitude == 0.0:
            yield Finding(
                "the origin is at 0°, 0°",
                Severity.BLOCKING,
                "This value means that it is not set.",
                "Wait for a fix, or set it in a ground station where there is no GPS.",
            )
            return
        yield Finding(
            f"origin: {last.latitude:.7f}°, {last.longitude:.7f}°, {last.altitude:.1f} m above the sea",
            Severity.OK,
            "It is the origin of the vehicle's own local frame; each vehicle has another one.",
        )
        return
    if case.log:
        found = _worked_out(case)
        place = (
            ""
            if found is None
            else f"; worked out from two positions: {found[0]:.6f}°, {found[1]:.6f}°, {found[2]:.1f} m"
        )
        yield Finding(
            f"the log has no GPS_GLOBAL_ORIGIN{place}",
            Severity.WARNING if found is not None else Severity.BLOCKING,
            "Without it set-points and positions cannot be related to those of others.",
            "fly asks for it (REQUEST_MESSAGE 49), and replay works it out; record the answer.",
        )
        return
    yield Finding(
        "no GPS_GLOBAL_ORIGIN, though it was asked for",
        Severity.BLOCKING,
        "The origin of its local frame is unknown, so neither target nor neighbours can be placed in it.",
        "Wait for a fix; indoors set it in a ground station (SET_GPS_GLOBAL_ORIGIN).",
    )


def home(case: Case) -> Iterator[Finding]:
    """Yield findings on HOME_POSITION: return flies to home, set-points are relative to the origin."""
    reported, origins = case.vehicle.latest(HomePosition), case.vehicle.origins
    if reported is None:
        yield Finding(
            "home is not told (HOME_POSITION)",
            Severity.NOTE,
            "The autopilot's own return flies there.",
            "" if case.log else "Wait for a fix; it is set on arming at the latest.",
        )
        return
    if not origins:
        return
    east, north, up = (
        float(part)
        for part in _frame(origins[-1]).to_enu(reported.latitude, reported.longitude, reported.altitude)
    )
    away = float(np.hypot(east, north))
    what = f"home is {away:.1f} m from the origin, {abs(up):.1f} m {'above' if up >= 0.0 else 'below'} it"
    if away > _MAX_HOME_DISTANCE_M:
        yield Finding(
            what,
            Severity.WARNING,
            "A failsafe's return flies this distance, and no other vehicle's plan allows for it.",
            "Set home here (MAV_CMD_DO_SET_HOME), or restart the autopilot where it stands.",
        )
    else:
        yield Finding(
            what, Severity.OK, "Return and landing go to home; set-points are relative to the origin."
        )


def agreement(case: Case) -> Iterator[Finding]:
    """Yield findings on the agreement of LOCAL_POSITION_NED and GLOBAL_POSITION_INT.

    Positions are compared through the origin, and the climb rate with the change of height.
    """
    pair, origins = case.vehicle.pair, case.vehicle.origins
    if pair is not None and origins:
        there, here = pair
        claimed = np.asarray(_frame(origins[-1]).to_enu(there.latitude, there.longitude, there.altitude))
        off = claimed - ned_to_enu(np.asarray(here.position_ned))
        away = float(np.hypot(off[0], off[1]))
        allowed = _MAX_DISTANCE_M + 0.2 * float(np.linalg.norm(here.velocity_ned))
        if not away <= allowed:
            yield Finding(
                f"local and global position disagree by {away:.1f} m",
                Severity.BLOCKING,
                "Either the reported origin is not the local frame's, or one of the positions is wrong.",
                "Restart the autopilot; if they still disagree, do not fly this firmware with others.",
            )
        else:
            yield Finding(
                f"local and global position agree ({away:.1f} m apart)",
                Severity.OK,
                "The origin is the right one.",
            )
    slope = case.vehicle.climb.value
    if slope is not None and slope < _MAX_REVERSED_SLOPE:
        yield Finding(
            "GLOBAL_POSITION_INT says vz positive when it climbs",
            Severity.WARNING,
            "MAVLink defines vz as positive downwards: others would predict a descent when it climbs.",
            "Reverse the sign where this vehicle is a target or a neighbour (velocity_up: true).",
        )


def _frame(place: GpsGlobalOrigin) -> FleetFrame:
    return FleetFrame(place.latitude, place.longitude, place.altitude)


def _worked_out(case: Case) -> tuple[float, float, float] | None:
    """Return the local frame's origin (°, °, m), computed from one position in both frames."""
    if case.vehicle.pair is None:
        return None
    there, here = case.vehicle.pair
    if not _placed(there):
        return None
    frame = FleetFrame(there.latitude, there.longitude, there.altitude)
    return frame.to_geodetic(tuple(-ned_to_enu(np.asarray(here.position_ned))))


def _placed(place: GlobalPosition) -> bool:
    """Return whether ``place`` is valid: without a fix it is all zeros."""
    return bool(place.latitude or place.longitude)
