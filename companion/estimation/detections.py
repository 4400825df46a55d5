"""Detections of a target by cameras, as the fusion filter takes them.

A detection says where the target is: along the ray with σ_s, which a known height of the target makes large,
and across it with σ_t sideways and σ_e up and down. CAMERA_TRACKING_GEO_STATUS gives σ_t as the accuracy of
the heading, the horizontal accuracy h and the vertical one v. h² + v² is the trace σ_s² + σ_t² + σ_e². σ_e is
not sent. A detector measures the column of an object in its middle and the row at its foot, with equal errors
in pixels: the middle of a standing object seen from above is nearer than its foot, so its heading is known
better. With the distances d of the foot and o of the top along the ray, σ_t/σ_e = 2o/(d + o)
(``mavlink_bridge.pinhole.covariance``). A message with a velocity is an estimate: a tracker has filtered it.
"""

from __future__ import annotations

from math import hypot, inf, radians, sqrt
from typing import NamedTuple

import numpy as np

from companion.config.target_source import FusedSource
from companion.values.horizon import Array
from mavlink_bridge.frames import Point
from mavlink_bridge.messages import CameraTrackingGeo

_MAX_SIGMA_M, _MAX_BEARING_RAD, _MAX_DISTANCE_M = 100.0, 0.5, 2000.0
"""Accuracies and distances beyond these are absurd."""
_MIN_SIGMA_M = 0.01
"""No camera is believed to be more accurate (m)."""
_NEAREST_TOP = 0.5
"""Least distance of an object's top along the ray, as a share of that of its foot."""
_MIN_LEVEL = 1e-6
"""Cosine of a ray's elevation below which the ray counts as vertical."""


class Detection(NamedTuple):
    """Detection of the target by the camera of ``vehicle`` in an image taken at ``time`` (µs).

    ``fields`` (FIELDS,): as ``fusion_filter`` takes them. ``estimate``: whether it is an estimate
    that may have detections in common with others. ``weight`` (1/m²): w_k of the camera at this distance,
    with the errors of the vehicle. ``message``: as received.
    """

    vehicle: int
    time: int
    fields: Array
    estimate: bool
    weight: float
    message: CameraTrackingGeo


def detection(
    config: FusedSource, vehicle: int, time: int, place: Point, camera: Point, message: CameraTrackingGeo
) -> Detection | None:
    """Return the detection in ``message`` of a camera at ``camera``; ``place``: the target's. Both ENU, m.

    Returns None for one whose accuracies or distance are absurd. Every detection that is received passes
    here; for three numbers floats are ten times as fast as NumPy.
    """
    x, y, z = place[0] - camera[0], place[1] - camera[1], place[2] - camera[2]
    distance = sqrt(x * x + y * y + z * z)
    # Within these limits the places are finite.
    if not 1e-3 < distance <= _MAX_DISTANCE_M:
        return None
    x, y, z = x / distance, y / distance, z / distance
    top = max(distance + config.height * z, _NEAREST_TOP * distance)
    taller = 1.0 if message.heading_accuracy is None else ((distance + top) / (2.0 * top)) ** 2
    across, along = _accuracies(config, distance, hypot(x, y), taller, message)
    if not (0.0 < across <= _MAX_SIGMA_M and 0.0 < along <= _MAX_SIGMA_M):
        return None
    level = hypot(x, y)
    # Straight below the camera the yaw moves nothing.
    up = (-z * x / level, -z * y / level, level) if level > _MIN_LEVEL else (1.0, 0.0, 0.0)
    wide, longer = across * across, along * along - across * across
    a, b, c = up
    more = wide * (taller - 1.0)
    xx = wide + longer * x * x + more * a * a
    yy = wide + longer * y * y + more * b * b
    zz = wide + longer * z * z + more * c * c
    xy = longer * x * y + more * a * b
    xz = longer * x * z + more * a * c
    yz = longer * y * z + more * b * c
    fields = np.array(
        (
            *place,
            *(xx, xy, xz, xy, yy, yz, xz, yz, zz),
            *(-y, x, 0.0),
            *up,
            *camera,
            distance,
        )
    )
    errors = config.errors
    white, common = errors.sigma_white**2, errors.sigma_horizontal**2
    sideways = wide + white + common + (radians(errors.sigma_yaw_deg) * distance * level) ** 2
    lengthways = (along * level) ** 2 + white + common
    weight = 0.5 * (1.0 / sideways - 1.0 / lengthways)
    return Detection(vehicle, time, fields, message.velocity_ned is not None, weight, message)


def _accuracies(
    config: FusedSource, distance: float, level: float, taller: float, message: CameraTrackingGeo
) -> tuple[float, float]:
    """Return σ across the ray, sideways, and along it, m; ∞ for absurd ones.

    ``level``: cosine of the ray's elevation; ``taller``: σ_e²/σ_t². What the camera does not say is as
    configured.
    """
    heading = message.heading_accuracy
    horizontal, vertical = message.horizontal_accuracy, message.vertical_accuracy
    # The accuracy of a heading is an angle in the horizontal plane.
    bearing = radians(config.sigma_bearing_deg) if heading is None else heading * level
    if heading is not None and not (heading > 0.0 and bearing <= _MAX_BEARING_RAD):
        return inf, inf
    across = max(distance * bearing, _MIN_SIGMA_M)
    if horizontal is None or vertical is None:
        return across, max(distance * config.sigma_range_share, across)
    if not (0.0 < horizontal <= _MAX_SIGMA_M and 0.0 < vertical <= _MAX_SIGMA_M):
        return inf, inf
    if heading is None:
        across = max(min(across, horizontal, vertical), _MIN_SIGMA_M)
    square = horizontal**2 + vertical**2 - (1.0 + taller) * across**2
    return across, max(sqrt(max(square, 0.0)), across)
