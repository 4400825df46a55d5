"""Identity of the vehicle: firmware, version, type, mode, MAVLink version."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import AutopilotVersion, ExtendedSysState
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity
from outrider.logs.flight_modes import ROTORCRAFT, mode_of
from outrider.logs.words import enumerated

_MEASURED_VERSIONS: Final = {mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: (4, 6), mavlink.MAV_AUTOPILOT_PX4: (1, 16)}
_TAKES_SETPOINTS: Final = mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
_MAX_SILENCE_S: Final = 5.0
_STARTING: Final = (mavlink.MAV_STATE_BOOT, mavlink.MAV_STATE_CALIBRATING)


def firmware(case: Case) -> Iterator[Finding]:
    """Yield findings on the kind of autopilot and vehicle."""
    beat = case.vehicle.vehicle.heartbeat
    if beat is None:
        return
    kind = (enumerated("MAV_TYPE", beat.type) or "").removeprefix("MAV_TYPE_").lower().replace("_", " ")
    if case.profile is None:
        name = (enumerated("MAV_AUTOPILOT", beat.autopilot) or "").removeprefix("MAV_AUTOPILOT_").lower()
        yield Finding(
            f"an autopilot that is not known: {name} ({beat.autopilot}), {kind}",
            Severity.BLOCKING,
            "A companion can arm and steer ArduPilot (3) and PX4 (12) only.",
            "Use ArduCopter or PX4.",
        )
        return
    if beat.type not in ROTORCRAFT:
        yield Finding(
            f"{case.profile.name}, {kind}: no multicopter",
            Severity.BLOCKING,
            "An escort stands still in the air, goes sideways and turns on the spot.",
            "Use a vehicle that hovers; if it is one, set its frame (FRAME_CLASS; SYS_AUTOSTART and "
            "MAV_TYPE with PX4).",
        )
    yield from _version(case, kind)


def _version(case: Case, kind: str) -> Iterator[Finding]:
    name = case.profile.name if case.profile is not None else ""
    reported = case.vehicle.latest(AutopilotVersion)
    if reported is None or not reported.flight_version:
        yield Finding(
            f"{name}, {kind}; its version is not told (AUTOPILOT_VERSION)",
            Severity.NOTE if case.log else Severity.WARNING,
            "The measurements with ArduCopter 4.6 and PX4 1.16 may not hold for it.",
            "Nobody asked for it in this log."
            if case.log
            else "See that REQUEST_MESSAGE reaches it; an old firmware: update it.",
        )
        return
    major, minor, patch, _ = reported.flight_version.to_bytes(4, "big")
    what = f"{name} {major}.{minor}.{patch}, {kind}, system {case.vehicle.source.system}"
    tried = _MEASURED_VERSIONS[case.autopilot]
    if (major, minor) == tried:
        yield Finding(what, Severity.OK, "This version has been measured.")
    elif (major, minor) < tried:
        yield Finding(
            what,
            Severity.WARNING,
            f"Older than what has been measured ({tried[0]}.{tried[1]}): it may refuse set-points with "
            "acceleration or yaw rate.",
            f"Update it to {name} {tried[0]}.{tried[1]}, or try it without people first.",
        )
    else:
        yield Finding(
            what,
            Severity.NOTE,
            f"Newer than what has been measured ({tried[0]}.{tried[1]}): parameters may have other names.",
            "Read its release notes on guided or offboard flight.",
        )
    if reported.capabilities and not reported.capabilities & _TAKES_SETPOINTS:
        yield Finding(
            "it says that it takes no SET_POSITION_TARGET_LOCAL_NED",
            Severity.BLOCKING,
            "An escort sends no other set-points.",
            "Use a build that takes it: ArduCopter with GUIDED, PX4 with OFFBOARD.",
        )


def dialect(case: Case) -> Iterator[Finding]:
    """Yield findings on MAVLink 1 or 2 and on signing."""
    vehicle = case.vehicle
    if vehicle.versions == {1}:
        yield Finding(
            "it speaks MAVLink 1",
            Severity.WARNING,
            "Nothing can be signed, and messages with ids above 255 cannot be sent.",
            "SERIALn_PROTOCOL = 2 (ArduPilot), MAV_PROTO_VER = 2 (PX4).",
        )
    if vehicle.signed:
        yield Finding(
            f"{vehicle.signed / max(vehicle.frames, 1):.0%} of its messages are signed",
            Severity.NOTE,
            "It obeys only those who sign with its key.",
            "Give the companion its key file (docs/signing.md), and the doctor too (--key): unsigned it "
            "hears no answers.",
        )


def state(case: Case) -> Iterator[Finding]:
    """Yield findings on mode, motors, landed state and system status."""
    beat = case.vehicle.vehicle.heartbeat
    if beat is None:
        return
    if not case.log and not case.vehicle.vehicle.alive:
        yield Finding(
            f"no HEARTBEAT for {case.silent_for(mavlink.MAVLINK_MSG_ID_HEARTBEAT):.0f} s",
            Severity.BLOCKING,
            "It is unknown whether it still follows set-points; after 3 s a companion sends nothing more.",
            "See whether the autopilot hangs or the link is gone.",
        )
    elif case.log and case.silent > _MAX_SILENCE_S:
        yield Finding(
            f"it says nothing in the last {case.silent:.0f} s of the log",
            Severity.WARNING,
            "The link was lost, or the vehicle was switched off. All findings describe its state before.",
            "If it was not switched off: a stronger radio, or a companion on board, which needs no radio.",
        )
    mode = mode_of(beat)
    armed = "armed" if case.vehicle.vehicle.armed else "disarmed"
    where = _where(case)
    steered = case.vehicle.vehicle.in_guided_mode
    what = f"mode {mode}, {armed}{where}"
    if case.px4 and steered and not case.vehicle.vehicle.armed and not case.log:
        yield Finding(
            what,
            Severity.WARNING if case.vehicle.vehicle.healthy else Severity.BLOCKING,
            "In OFFBOARD the pre-arm check of PX4 fails while no set-points come, and no text says so.",
            "Switch it to HOLD in a ground station (DO_SET_MODE 1, 4, 3), then ask again.",
        )
    elif not case.vehicle.vehicle.armed or case.log:
        why = (
            "This is its state where the log ends."
            if case.log
            else "An escort arms it after the operator's go, and changes the mode itself."
        )
        yield Finding(what, Severity.OK, why)
    else:
        yield Finding(
            what,
            Severity.WARNING,
            "Set-points of another sender may steer it now."
            if steered
            else "It is armed in another mode: after a go the companion takes it over where it is.",
            "Land and disarm it, unless it is meant to be taken over in the air.",
        )
    if beat.system_status in _STARTING:
        yield Finding(
            "it is still starting",
            Severity.BLOCKING,
            "Sensors are being calibrated; it refuses to arm.",
            "Leave it still and ask again in half a minute.",
        )
    elif beat.system_status >= mavlink.MAV_STATE_CRITICAL:
        yield Finding(
            "its state is critical"
            if beat.system_status == mavlink.MAV_STATE_CRITICAL
            else "its state is an emergency, or it shuts down",
            Severity.BLOCKING,
            "A failsafe of the autopilot is at work (battery, estimator, links), and has the last word.",
            _last_warning(case) or "Look at its STATUSTEXTs in a ground station.",
        )
    if losses := case.vehicle.guided_losses:
        yield Finding(
            f"while armed it fell out of the mode that set-points steer, {losses} times",
            Severity.WARNING,
            "It does so when set-points stop for longer than COM_OF_LOSS_T; COM_OBL_RC_ACT selects its "
            "reaction.",
            "Set COM_OBL_RC_ACT to 5 (hold), and find the cause of the interruption.",
        )


def _where(case: Case) -> str:
    extended = case.vehicle.latest(ExtendedSysState)
    if extended is None:
        return ""
    words = {
        mavlink.MAV_LANDED_STATE_ON_GROUND: ", on the ground",
        mavlink.MAV_LANDED_STATE_IN_AIR: ", in the air",
        mavlink.MAV_LANDED_STATE_TAKEOFF: ", taking off",
        mavlink.MAV_LANDED_STATE_LANDING: ", landing",
    }
    return words.get(extended.landed_state, "")


def _last_warning(case: Case) -> str:
    return f"It said: {case.vehicle.vehicle.said!r}. Answer that first." if case.vehicle.vehicle.said else ""
