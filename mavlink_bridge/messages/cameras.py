"""Messages of cameras and gimbals: what a camera is, where it looks, and what it tracks.

Attitudes are quaternions (w, x, y, z) that rotate camera axes (x along the optical axis, y to the right and z
down in the image) to NED.
"""

from __future__ import annotations

from math import degrees, isfinite, nan, radians
from typing import NamedTuple

from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import Fields, ascii_bytes, ascii_text, degrees_e7, on_globe
from mavlink_bridge.messages.source import Source, Vector

Quaternion = tuple[float, float, float, float]
Place = tuple[float, float, float]
"""Latitude and longitude (degrees), altitude above mean sea level (m)."""

_UNKNOWN_I32 = 0x7FFF_FFFF
_NAME = 32
_URI = 140


@message("CAMERA_INFORMATION")
class CameraInformation(NamedTuple):
    """CAMERA_INFORMATION (259): a camera's name, optics and abilities.

    ``focal_length`` and ``sensor_size`` (across, down) in mm, None if unknown; ``resolution`` in pixels.
    ``flags``: CAMERA_CAP_FLAGS. ``gimbal``: component id of its gimbal, 0 without one.
    """

    source: Source
    time_boot: int
    vendor: str
    model: str
    firmware: int
    focal_length: float | None
    sensor_size: tuple[float, float] | None
    resolution: tuple[int, int]
    flags: int
    gimbal: int = 0
    lens: int = 0
    definition_version: int = 0
    definition_uri: str = ""
    device: int = 0

    @staticmethod
    def decode(source: Source, fields: Fields) -> CameraInformation:
        time, firmware, focal_length, across, down, flags, width, height, version = fields[:9]
        vendor, model, lens, uri, gimbal, device = fields[9:]
        return CameraInformation(
            source,
            time * 1000,
            ascii_text(vendor),
            ascii_text(model),
            firmware,
            _known(focal_length),
            (across, down) if isfinite(across + down) else None,
            (width, height),
            flags,
            gimbal,
            lens,
            version,
            ascii_text(uri),
            device,
        )

    def encode(self) -> Fields:
        return (
            self.time_boot // 1000,
            self.firmware,
            _or_nan(self.focal_length),
            *(self.sensor_size or (nan, nan)),
            self.flags,
            *self.resolution,
            self.definition_version,
            ascii_bytes("CAMERA_INFORMATION: vendor_name", self.vendor, _NAME),
            ascii_bytes("CAMERA_INFORMATION: model_name", self.model, _NAME),
            self.lens,
            ascii_bytes("CAMERA_INFORMATION: cam_definition_uri", self.definition_uri, _URI),
            self.gimbal,
            self.device,
        )


@message("CAMERA_FOV_STATUS")
class CameraFovStatus(NamedTuple):
    """CAMERA_FOV_STATUS (271): where a camera was, and where it looked, at ``time_boot`` (µs).

    ``place`` is the camera's, ``image_place`` that of the centre of its image, None if unknown.
    ``horizontal_field`` and ``vertical_field``: angles of view (rad).
    """

    source: Source
    time_boot: int
    place: Place | None
    image_place: Place | None
    attitude: Quaternion
    horizontal_field: float
    vertical_field: float
    device: int = 0

    @staticmethod
    def decode(source: Source, fields: Fields) -> CameraFovStatus | None:
        across, down = fields[11:13]
        if not isfinite(sum(fields[7:13])):
            return None
        return CameraFovStatus(
            source,
            fields[0] * 1000,
            _place(*fields[1:4]),
            _place(*fields[4:7]),
            fields[7:11],
            radians(across),
            radians(down),
            fields[13],
        )

    def encode(self) -> Fields:
        return (
            self.time_boot // 1000,
            *_placed(self.place),
            *_placed(self.image_place),
            *self.attitude,
            degrees(self.horizontal_field),
            degrees(self.vertical_field),
            self.device,
        )


@message("CAMERA_TRACKING_GEO_STATUS")
class CameraTrackingGeo(NamedTuple):
    """CAMERA_TRACKING_GEO_STATUS (276): position of the object that a camera tracks.

    Degrees, m above mean sea level, m/s NED. ``status`` is CAMERA_TRACKING_STATUS_FLAGS: 1 while tracking.
    Accuracies are standard deviations (m, m/s, rad). ``distance`` (m) is from the camera; ``heading`` (rad,
    clockwise from north) is the direction from the camera. All but the position are None if unknown. The
    message has no time stamp.
    """

    source: Source
    status: int
    latitude: float
    longitude: float
    altitude: float
    velocity_ned: Vector | None
    horizontal_accuracy: float | None = None
    vertical_accuracy: float | None = None
    velocity_accuracy: float | None = None
    distance: float | None = None
    heading: float | None = None
    heading_accuracy: float | None = None
    device: int = 0

    @staticmethod
    def decode(source: Source, fields: Fields) -> CameraTrackingGeo | None:
        latitude, longitude, altitude, _, _, north, east, down = fields[:8]
        if not (on_globe(latitude, longitude) and isfinite(altitude)):
            return None
        velocity = (north, east, down) if isfinite(north + east + down) else None
        return CameraTrackingGeo(
            source,
            fields[12],
            latitude / 1e7,
            longitude / 1e7,
            altitude,
            velocity,
            _known(fields[3]),
            _known(fields[4]),
            _known(fields[8]),
            _known(fields[9]),
            _known(fields[10]),
            _known(fields[11]),
            fields[13],
        )

    def encode(self) -> Fields:
        return (
            *degrees_e7(self.latitude, self.longitude),
            self.altitude,
            _or_nan(self.horizontal_accuracy),
            _or_nan(self.vertical_accuracy),
            *(self.velocity_ned or (nan, nan, nan)),
            _or_nan(self.velocity_accuracy),
            _or_nan(self.distance),
            _or_nan(self.heading),
            _or_nan(self.heading_accuracy),
            self.status,
            self.device,
        )


@message("CAMERA_TRACKING_IMAGE_STATUS")
class CameraTrackingImage(NamedTuple):
    """CAMERA_TRACKING_IMAGE_STATUS (275): place in the image of the object that a camera tracks.

    ``status`` is CAMERA_TRACKING_STATUS_FLAGS, ``mode`` CAMERA_TRACKING_MODE, ``data``
    CAMERA_TRACKING_TARGET_DATA. Coordinates are shares of the image's width and height, from the upper left:
    ``point`` (x, y), ``radius`` of the width, ``rectangle`` (left, top, right, bottom); None if unknown.
    """

    source: Source
    status: int
    mode: int
    data: int
    point: tuple[float, float] | None
    radius: float | None
    rectangle: tuple[float, float, float, float] | None
    device: int = 0

    @staticmethod
    def decode(source: Source, fields: Fields) -> CameraTrackingImage:
        x, y, radius, *rectangle, status, mode, data, device = fields
        left, top, right, bottom = rectangle
        return CameraTrackingImage(
            source,
            status,
            mode,
            data,
            (x, y) if isfinite(x + y) else None,
            _known(radius),
            (left, top, right, bottom) if isfinite(sum(rectangle)) else None,
            device,
        )

    def encode(self) -> Fields:
        return (
            *(self.point or (nan, nan)),
            _or_nan(self.radius),
            *(self.rectangle or (nan, nan, nan, nan)),
            self.status,
            self.mode,
            self.data,
            self.device,
        )


@message("GIMBAL_DEVICE_ATTITUDE_STATUS")
class GimbalAttitude(NamedTuple):
    """GIMBAL_DEVICE_ATTITUDE_STATUS (285): attitude of a gimbal at ``time_boot`` (µs).

    ``flags``: GIMBAL_DEVICE_FLAGS, which say whether yaw is relative to north or to the vehicle's heading.
    ``body_rates`` rad/s. ``delta_yaw`` (rad) and its rate (rad/s): yaw relative to north minus yaw relative
    to the vehicle's heading. They are None if unknown. They are extension fields: a sender that does not know
    these fields, and one that sends exactly 0, both give 0.0.
    """

    source: Source
    time_boot: int
    flags: int
    attitude: Quaternion
    body_rates: Vector | None
    target_system: int = 0
    target_component: int = 0
    failure_flags: int = 0
    delta_yaw: float | None = None
    delta_yaw_rate: float | None = None
    device: int = 0

    @staticmethod
    def decode(source: Source, fields: Fields) -> GimbalAttitude | None:
        time, *rest = fields
        attitude, (x, y, z), failures, flags, system, component = rest[:4], rest[4:7], *rest[7:11]
        if not isfinite(sum(attitude)):
            return None
        w, i, j, k = attitude
        return GimbalAttitude(
            source,
            time * 1000,
            flags,
            (w, i, j, k),
            (x, y, z) if isfinite(x + y + z) else None,
            system,
            component,
            failures,
            _known(rest[11]),
            _known(rest[12]),
            rest[13],
        )

    def encode(self) -> Fields:
        return (
            self.time_boot // 1000,
            *self.attitude,
            *(self.body_rates or (nan, nan, nan)),
            self.failure_flags,
            self.flags,
            self.target_system,
            self.target_component,
            _or_nan(self.delta_yaw),
            _or_nan(self.delta_yaw_rate),
            self.device,
        )


def _known(value: float) -> float | None:
    """Return ``value``, or None if it is not finite: a camera reports what it does not know as NaN."""
    return value if isfinite(value) else None


def _or_nan(value: float | None) -> float:
    return nan if value is None else value


def _place(latitude: int, longitude: int, altitude: int) -> Place | None:
    if _UNKNOWN_I32 in (latitude, longitude, altitude) or not on_globe(latitude, longitude):
        return None
    return latitude / 1e7, longitude / 1e7, altitude / 1e3


def _placed(place: Place | None) -> tuple[int, int, int]:
    if place is None:
        return _UNKNOWN_I32, _UNKNOWN_I32, _UNKNOWN_I32
    return *degrees_e7(place[0], place[1]), round(place[2] * 1e3)
