"""Cameras of the vehicle: what they say about a tracked target, how accurate, and of what time.

Detections may also come through a forwarder: another component of the vehicle, or another vehicle's
companion.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import atan, degrees
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    Attitude,
    CameraFovStatus,
    CameraInformation,
    CameraTrackingGeo,
    CameraTrackingImage,
)
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity
from outrider.doctor.hearing import Hearing
from outrider.doctor.sender_record import SenderRecord

_GEO: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS
_IMAGE: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_IMAGE_STATUS
_FOV: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_FOV_STATUS
_ATTITUDE: Final[int] = mavlink.MAVLINK_MSG_ID_ATTITUDE
_GIMBAL: Final[int] = mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS
_SAID_BY_CAMERAS: Final = frozenset((_GEO, _IMAGE, _FOV, mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION))
_POSITION: Final[int] = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
_CAMERAS: Final = range(mavlink.MAV_COMP_ID_CAMERA, mavlink.MAV_COMP_ID_CAMERA6 + 1)
_MAX_LATENCY_S: Final = 5.0
"""An image that seems older than this (s), or newer than now, has a stamp of another clock."""
_ALLOWED_LEAD_S: Final = 0.05


def cameras_of(hearing: Hearing, system: int) -> list[SenderRecord]:
    """Return the cameras of ``system``: by their heartbeat, or because they say what cameras say."""
    found = [one for source, one in sorted(hearing.senders.items()) if source.system == system]
    return [one for one in found if _is_camera(one)]


def cameras(case: Case) -> Iterator[Finding]:
    """Yield what each camera of the vehicle says, and what others tell of targets; nothing without any."""
    yield from _from_others(case)
    for camera in cameras_of(case.hearing, case.vehicle.source.system):
        name = _name(camera)
        if _GEO in camera.streams:
            yield _geo(name, camera)
        if _IMAGE in camera.streams:
            yield from _image(name, camera, case)
        if _GEO in camera.streams or _IMAGE in camera.streams:
            yield _time(name, camera, case)
        else:
            yield Finding(
                f"{name} tells of no target",
                Severity.NOTE,
                "It sends neither CAMERA_TRACKING_GEO_STATUS (276) nor CAMERA_TRACKING_IMAGE_STATUS (275)."
                " Many cameras send them only while they track something, and after a request.",
                "Let it track something in view, and examine it again.",
            )


def _name(sender: SenderRecord) -> str:
    beat = sender.heartbeat
    camera = beat is not None and beat.type == mavlink.MAV_TYPE_CAMERA
    kind = "camera" if camera or sender.source.component in _CAMERAS else "forwarder"
    return "{} {}/{}".format(kind, *sender.source)


def _from_others(case: Case) -> Iterator[Finding]:
    """Yield what senders with another system id than the vehicle's tell of targets."""
    senders, own = case.hearing.senders, case.vehicle.source.system
    vehicles = {
        source.system for source, one in senders.items() if one.is_autopilot or _POSITION in one.streams
    }
    for source, one in sorted(senders.items()):
        speaks = [message for message in (_GEO, _IMAGE) if message in one.streams]
        if source.system == own or not speaks:
            continue
        if source.system not in vehicles:
            yield Finding(
                f"{_name(one)} has the system id of no vehicle",
                Severity.WARNING,
                "A detection counts under the id of the vehicle that made it. Those of the own camera have"
                f" the id {own}; those on the swarm link that of a vehicle whose companion reports a place.",
                f"Give the camera, or what forwards its messages, the vehicle's system id (here {own}).",
            )
        elif _GEO not in speaks or _FOV not in one.streams:
            yield Finding(
                f"{_name(one)} tells of a target, but not as companions need it",
                Severity.WARNING,
                "Of another vehicle counts CAMERA_TRACKING_GEO_STATUS (276) with CAMERA_FOV_STATUS (271)"
                " before it in the same datagram, which has the time of the image and the camera's place.",
                "Send both, as a companion with target_source.share does.",
            )
        else:
            yield _geo(f"{_name(one)} of another vehicle", one)


def _is_camera(sender: SenderRecord) -> bool:
    beat = sender.heartbeat
    kind = beat is not None and beat.type == mavlink.MAV_TYPE_CAMERA
    return bool(kind) or not _SAID_BY_CAMERAS.isdisjoint(sender.streams)


def _geo(name: str, camera: SenderRecord) -> Finding:
    what = f"{name} speaks CAMERA_TRACKING_GEO_STATUS (276) at {camera.rate(_GEO):.3g} Hz"
    said = camera.latest(CameraTrackingGeo)
    if said is None:
        return Finding(
            f"{what}, without a place",
            Severity.WARNING,
            "Latitude, longitude or altitude is no number or not on the globe; such messages are dropped.",
            "See that the camera knows the vehicle's position.",
        )
    fields = {
        "h_acc": said.horizontal_accuracy,
        "v_acc": said.vertical_accuracy,
        "dist": said.distance,
        "hdg": said.heading,
        "hdg_acc": said.heading_accuracy,
    }
    # NaN means unknown. Zero is what a field holds that was never set, and no camera is as good.
    missing = [field for field, value in fields.items() if value is None or (field != "hdg" and value <= 0.0)]
    if missing:
        return Finding(
            f"{what}, without {', '.join(missing)}",
            Severity.WARNING,
            "A target that is fused from several vehicles needs the accuracy of each detection: what is not"
            " told has to be assumed.",
            "Have the camera fill them in, or see that the companion's settings state how good it is.",
        )
    return Finding(f"{what}, with all accuracies", Severity.OK, "They weigh its detections against others'.")


def _image(name: str, camera: SenderRecord, case: Case) -> Iterator[Finding]:
    alone = "" if _GEO in camera.streams else " alone"
    what = f"{name} speaks CAMERA_TRACKING_IMAGE_STATUS (275){alone} at {camera.rate(_IMAGE):.3g} Hz"
    said = camera.latest(CameraTrackingImage)
    if said is not None and said.rectangle is None:
        yield Finding(
            f"{what}, without a rectangle",
            Severity.WARNING if alone else Severity.NOTE,
            "The distance of the target follows from its height in the image, which only a rectangle has.",
            "Have it track a rectangle (MAV_CMD_CAMERA_TRACK_RECTANGLE, 2005).",
        )
    else:
        yield Finding(
            what, Severity.NOTE, "The companion computes the place, from optics, attitude and assumed height."
        )
    if alone and not _turns(case) and _FOV not in camera.streams:
        yield Finding(
            f"{name} does not tell where it looks",
            Severity.NOTE,
            "Neither CAMERA_FOV_STATUS (271) nor GIMBAL_DEVICE_ATTITUDE_STATUS (285) comes.",
            "If it is fixed to the vehicle, state its target_source.optics.pitch_deg; otherwise have its"
            " gimbal send its attitude.",
        )
    if alone and _FOV not in camera.streams:
        yield _optics(name, camera)


def _optics(name: str, camera: SenderRecord) -> Finding:
    """Return the finding about the angles of view of a camera that does not send them with its images."""
    about = camera.latest(CameraInformation)
    focal_length = (about.focal_length if about else None) or 0.0
    sides = (about.sensor_size if about else None) or (0.0, 0.0)
    # Zero is what a field holds that was never set.
    if min(focal_length, *sides) <= 0.0:
        return Finding(
            f"{name} does not tell its optics",
            Severity.WARNING,
            "Without angles of view, a place in the image has no direction: its detections are dropped.",
            "State width_deg and height_deg of target_source.optics in the companion's settings.",
        )
    across, down = (degrees(2.0 * atan(0.5 * side / focal_length)) for side in sides)
    return Finding(
        f"{name} does not tell its angles of view with its images",
        Severity.NOTE,
        "CAMERA_FOV_STATUS (271) does not come. Without target_source.optics the companion drops its"
        " detections.",
        f"State target_source.optics: {{width_deg: {across:.1f}, height_deg: {down:.1f}}}, by its"
        " CAMERA_INFORMATION (259).",
    )


def _turns(case: Case) -> bool:
    """Return whether a gimbal of the vehicle tells its attitude."""
    system = case.vehicle.source.system
    return any(
        source.system == system and _GIMBAL in one.streams for source, one in case.hearing.senders.items()
    )


def _time(name: str, camera: SenderRecord, case: Case) -> Finding:
    """Return the finding about the time of the images; 276 and 275 have no time stamp."""
    view, latency = camera.latest(CameraFovStatus), _latency(camera, case)
    if view is None:
        return Finding(
            f"{name} does not tell when its images were taken",
            Severity.NOTE,
            "Its messages have no time stamp, and CAMERA_FOV_STATUS (271), which has one, does not come. A"
            " target that moves at 3 m/s is 0.6 m further after 200 ms.",
            "State the camera's latency in the companion's settings (target_source.latency_us).",
        )
    if latency is None:
        return Finding(f"{name} tells when its images were taken", Severity.OK, "By CAMERA_FOV_STATUS (271).")
    if not -_ALLOWED_LEAD_S <= latency <= _MAX_LATENCY_S:
        return Finding(
            f"{name} has another clock than the autopilot",
            Severity.WARNING,
            f"CAMERA_FOV_STATUS (271) is {latency:.3g} s behind the autopilot's time since boot; an image may"
            f" be up to {_MAX_LATENCY_S:g} s old.",
            "Have the camera follow the autopilot's clock (SYSTEM_TIME, TIMESYNC), or use its latency.",
        )
    return Finding(
        f"{name} tells of its images {1e3 * max(latency, 0.0):.0f} ms after they were taken",
        Severity.OK,
        "By CAMERA_FOV_STATUS (271), on the autopilot's clock.",
    )


def _latency(camera: SenderRecord, case: Case) -> float | None:
    """Return the age (s) of the last image when it was told, on the autopilot's clock; None if unknown."""
    view, attitude = camera.latest(CameraFovStatus), case.vehicle.latest(Attitude)
    if view is None or attitude is None or not attitude.time_boot:
        return None
    passed = camera.streams[_FOV].last - case.vehicle.streams[_ATTITUDE].last
    rate = case.vehicle.clock.rate or 1.0
    return 1e-6 * (attitude.time_boot + rate * passed - view.time_boot)
