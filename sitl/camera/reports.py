"""Messages about one image: where the camera looked, its gimbal's attitude, and what was detected."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    CameraFovStatus,
    CameraTrackingGeo,
    CameraTrackingImage,
    GimbalAttitude,
    Source,
    Vector,
)
from mavlink_bridge.pinhole import Extent, Pinhole, Quaternion, product, sighting
from sitl.values.attitudes import euler, quaternion
from sitl.values.camera import CameraConfig

Geodetic = Callable[[Vector], tuple[float, float, float]]
"""Returns latitude, longitude (degrees) and altitude (m) of a position in the vehicle's local NED (m)."""

_STABILISED: Final[int] = (
    mavlink.GIMBAL_DEVICE_FLAGS_ROLL_LOCK
    | mavlink.GIMBAL_DEVICE_FLAGS_PITCH_LOCK
    | mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME
)


class Pose(NamedTuple):
    """Estimated pose of the camera when it took an image.

    ``time`` on the autopilot's clock (µs since boot); ``place`` in the vehicle's local NED (m).
    """

    time: int
    place: Vector
    attitude: Quaternion


def fov_status(source: Source, camera: Pinhole, pose: Pose, geodetic: Geodetic) -> CameraFovStatus:
    """Return CAMERA_FOV_STATUS (271)."""
    return CameraFovStatus(source, pose.time, geodetic(pose.place), None, pose.attitude, *camera.fields)


def gimbal_attitude(source: Source, pose: Pose) -> GimbalAttitude:
    """Return GIMBAL_DEVICE_ATTITUDE_STATUS (285), with yaw relative to the vehicle's heading."""
    yaw = euler(pose.attitude)[2]
    relative = product(quaternion(0.0, 0.0, -yaw), pose.attitude)
    return GimbalAttitude(source, pose.time, _STABILISED, relative, None, delta_yaw=yaw)


def geo_status(
    source: Source, config: CameraConfig, camera: Pinhole, seen: Extent, pose: Pose, geodetic: Geodetic
) -> CameraTrackingGeo | None:
    """Return CAMERA_TRACKING_GEO_STATUS (276); None if ``seen`` fits no object in front of the camera.

    The accuracies are those of the camera alone. They do not contain the errors of the estimated pose, which
    all images of some seconds have in common.
    """
    known = config.object
    found = sighting(camera, pose.attitude, seen, known.height, config.pixel_sigma, known.height_sigma)
    if found is None:
        return None
    x, y, z = (a + b for a, b in zip(pose.place, found.offset, strict=True))
    latitude, longitude, altitude = geodetic((x, y, z))
    said = CameraTrackingGeo(
        source, mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE, latitude, longitude, altitude, None
    )
    if not config.accuracy or found.level == 0.0:
        return said
    return said._replace(
        horizontal_accuracy=found.horizontal_accuracy,
        vertical_accuracy=found.vertical_accuracy,
        distance=found.distance,
        heading=found.heading,
        heading_accuracy=found.heading_accuracy,
    )


def image_status(source: Source, config: CameraConfig, camera: Pinhole, seen: Extent) -> CameraTrackingImage:
    """Return CAMERA_TRACKING_IMAGE_STATUS (275), with a rectangle."""
    known = config.object
    half = 0.5 * (seen.foot - seen.top) * known.width / known.height
    rectangle = (
        (seen.column - half) / camera.width,
        seen.top / camera.height,
        (seen.column + half) / camera.width,
        seen.foot / camera.height,
    )
    return CameraTrackingImage(
        source,
        mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE,
        mavlink.CAMERA_TRACKING_MODE_RECTANGLE,
        mavlink.CAMERA_TRACKING_TARGET_DATA_IN_STATUS,
        None,
        None,
        rectangle,
    )
