"""Fields of view and detections of cameras, for pictures: a row of numbers for each vehicle.

The columns of a row are the place of the camera (3) in m, its attitude (4), w x y z from camera axes (x along
the optical axis, y right, z down) to NED, its horizontal and vertical angles of view (2) in rad, and the
detected place (3) in m. Places are fleet-local ENU. Unknown values are NaN: without a detection its place,
without a camera everything.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CameraFovStatus, CameraTrackingGeo, Message
from mavlink_bridge.pinhole import Quaternion, matrix

Array = NDArray[np.float64]
Single = NDArray[np.float32]
COLUMNS = 12
NO_VIEW: Single = np.full(COLUMNS, np.nan, np.float32)
NO_VIEW.flags.writeable = False
NO_VIEWS: Single = np.empty((0, COLUMNS), np.float32)
_TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))


def view_row(
    place: Sequence[float] | Array | None,
    attitude: Quaternion | None,
    fields: tuple[float, float] | None,
    detected: Sequence[float] | Array | None,
) -> Single:
    """Return the row of a camera; None for unknown parts."""
    row = NO_VIEW.copy()
    for value, columns in (
        (place, slice(0, 3)),
        (attitude, slice(3, 7)),
        (fields, slice(7, 9)),
        (detected, slice(9, 12)),
    ):
        if value is not None:
            row[columns] = value
    return row


def field_lines(views: Single, depth: float) -> Single:
    """Return the edges (K, 8, 2, 3) of fields of view up to ``depth`` (m) along the optical axis.

    ``views`` (K, 12). The first four lines of a camera begin at its place; NaN where a field is not known.
    """
    lines = np.full((len(views), 8, 2, 3), np.nan, np.float32)
    for row, found in zip(views.astype(np.float64), lines, strict=True):
        if not np.isfinite(row[:9]).all():
            continue
        across, down = np.tan(0.5 * row[7:9])
        corners = np.array([(1.0, x * across, y * down) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
        w, x, y, z = row[3:7].tolist()
        ends = row[:3] + depth * corners @ matrix((w, x, y, z)).T @ _TO_ENU.T
        found[:4, 0], found[:4, 1] = row[:3], ends
        for edge, (one, other) in enumerate(_EDGES):
            found[4 + edge] = ends[one], ends[other]
    return lines


def rays(views: Single, positions: Single) -> Single:
    """Return the lines (K, 2, 3) from cameras to what they detect; NaN without a detection.

    A camera whose place is not known is at the position (K, 3) of its vehicle.
    """
    known = np.isfinite(views[:, :3]).all(axis=1, keepdims=True)
    begins = np.where(known, views[:, :3], positions)
    return np.stack([begins, views[:, 9:]], axis=1).astype(np.float32)


class CameraReceiver:
    """Receiver of what a camera says; ``row`` is the latest.

    CAMERA_FOV_STATUS (271) begins an image; CAMERA_TRACKING_GEO_STATUS (276) tells what was detected in it.
    """

    def __init__(self) -> None:
        self.row: Single = NO_VIEW

    def receive(self, message: Message, frame: FleetFrame) -> bool:
        """Receive ``message``; return whether it changed the row. ``frame``: the fleet's."""
        if isinstance(message, CameraFovStatus):
            across, down = message.horizontal_field, message.vertical_field
            # Who forwards a detection tells the place of the camera alone.
            looks = across > 0.0 and down > 0.0 and any(message.attitude)
            place = None if message.place is None else frame.to_enu(*message.place)
            self.row = (
                view_row(place, message.attitude, (across, down), None)
                if looks
                else view_row(place, None, None, None)
            )
        elif isinstance(message, CameraTrackingGeo):
            self.row = self.row.copy()
            self.row[9:] = frame.to_enu(message.latitude, message.longitude, message.altitude)
        else:
            return False
        return True
