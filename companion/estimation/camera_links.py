"""Messages of cameras, matched to detections: those of the own camera, and those that neighbours forward.

CAMERA_FOV_STATUS (271) has the time of the image, on the clock of the vehicle's autopilot, and of a forwarded
one on that of the vehicle's companion. It comes before the detection, in the same datagram. Without it the
image is ``latency_us`` old, and the camera is where the vehicle was; where a place in an image is then seen
from follows from ``optics``, and without them such a detection is dropped.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import radians

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config.target_source import FusedSource
from companion.estimation.camera_pose import CameraPose
from companion.estimation.fused_target import FusedTarget
from companion.estimation.tracks import State
from companion.values.horizon import Array
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import (
    Attitude,
    CameraFovStatus,
    CameraTrackingGeo,
    CameraTrackingImage,
    GimbalAttitude,
    Source,
)
from mavlink_bridge.pinhole import Extent, Pinhole, sighting

CAMERA_MESSAGES = (CameraFovStatus, CameraTrackingGeo, CameraTrackingImage)
CameraMessage = CameraFovStatus | CameraTrackingGeo | CameraTrackingImage

_REMEMBERED = 64
"""Number of stamps of a sender by which a repeated detection is recognised."""
_WIDTH = 1000
"""Width (pixels) of the image in which places in an image are expressed."""
_FORWARD = 1.0, 0.0, 0.0, 0.0


class CameraLinks:
    """Receives the messages of cameras and gives detections to ``target``."""

    def __init__(self, source: FusedSource, fleet: FleetFrame, target: FusedTarget) -> None:
        self._source, self._fleet, self._target = source, fleet, target
        self._views: dict[Source, tuple[int, CameraFovStatus]] = {}
        self._stamps: dict[Source, deque[int]] = {}
        self._pose = None if source.optics is None else CameraPose(source.optics)

    def turned(self, time: int, message: Attitude | GimbalAttitude) -> None:
        """Receive the attitude of the own vehicle or of its gimbal at ``time`` (µs)."""
        if self._pose is None:
            return
        if isinstance(message, Attitude):
            self._pose.receive_attitude(time, message)
        else:
            self._pose.receive_gimbal(time, message)

    def own(
        self,
        now: int,
        message: CameraMessage,
        when: Callable[[int], int | None],
        vehicle: Callable[[], State | None],
    ) -> None:
        """Receive a message of the own camera at ``now`` (µs).

        ``when`` converts a stamp of the autopilot's clock to a time (µs), and returns None for one from the
        future; ``vehicle`` returns the own state at ``now``.
        """
        if isinstance(message, CameraFovStatus):
            self._views[message.source] = now, message
            return
        view, time = self._view(now, message.source), now - self._source.latency_us
        if view is not None:
            taken = when(view.time_boot)
            if taken is None:
                self._target.drop()
                return
            time = taken
        elif (own := vehicle()) is not None:
            place = own.position - 1e-6 * (now - time) * own.velocity
            view = self._assumed(time, message.source, place)
        if isinstance(message, CameraTrackingImage):
            found = None if view is None else self._projected(view, message)
            if found is None:
                self._target.drop()
                return
            message = found
        self._give(now, time, view, message)

    def _assumed(self, time: int, source: Source, place: Array) -> CameraFovStatus:
        """Return the field of view at ``time`` (µs) of a camera at ``place`` (3,), m, that does not tell it.

        Its angles are 0 if they, or where it looked, are not known.
        """
        optics, where = self._source.optics, self._fleet.to_geodetic(place)
        attitude = None if self._pose is None else self._pose.at(time)
        if optics is None or attitude is None:
            return CameraFovStatus(source, 0, where, None, _FORWARD, 0.0, 0.0)
        fields = radians(optics.width_deg), radians(optics.height_deg)
        return CameraFovStatus(source, 0, where, None, attitude, *fields)

    def forwarded(self, now: int, message: CameraMessage, when: Callable[[int], int | None]) -> None:
        """Receive a message that a neighbour forwards, at ``now`` (µs).

        ``when`` converts a stamp of its clock to a time (µs), and returns None if the neighbour is not of the
        fleet. A detection without the time of its image, or a repeated one, is dropped.
        """
        if isinstance(message, CameraFovStatus):
            self._views[message.source] = now, message
            return
        view = self._view(now, message.source)
        time = None if view is None else when(view.time_boot)
        if time is None or view is None or isinstance(message, CameraTrackingImage):
            self._target.drop()
            return
        stamps = self._stamps.setdefault(message.source, deque(maxlen=_REMEMBERED))
        if view.time_boot in stamps:
            self._target.drop()
            return
        stamps.append(view.time_boot)
        self._give(now, time, view, message)

    def _view(self, now: int, source: Source) -> CameraFovStatus | None:
        """Return the camera's field of view that arrived with the message at ``now`` (µs)."""
        received, view = self._views.get(source, (0, None))
        return view if received == now else None

    def _give(self, now: int, time: int, view: CameraFovStatus | None, message: CameraTrackingGeo) -> None:
        camera = None
        if view is not None and view.place is not None:
            camera = self._fleet.to_east_north_up(*view.place)
        self._target.receive(now, time, camera, view, message)

    def _projected(self, view: CameraFovStatus, message: CameraTrackingImage) -> CameraTrackingGeo | None:
        """Return the place of an object of the configured height from its rectangle in the image.

        Returns None if it has none, or shows no object in front of the camera.
        """
        source, rectangle, place = self._source, message.rectangle, view.place
        fields = view.horizontal_field, view.vertical_field
        tracks = message.status == mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE
        if rectangle is None or place is None or not tracks or not all(0.0 < one < 3.0 for one in fields):
            return None
        height = round(_WIDTH * np.tan(0.5 * fields[1]) / np.tan(0.5 * fields[0]))
        camera = Pinhole.of_field(_WIDTH, max(height, 1), fields[0])
        left, top, right, bottom = rectangle
        seen = Extent(0.5 * (left + right) * _WIDTH, top * height, bottom * height)
        sigmas = source.sigma_row * height, source.sigma_height
        found = sighting(camera, view.attitude, seen, source.height, *sigmas)
        if found is None or found.level == 0.0:
            return None
        north, east, down = found.offset
        start = np.array(self._fleet.to_east_north_up(*place))
        where = self._fleet.to_geodetic(start + np.array([east, north, -down]))
        return CameraTrackingGeo(
            message.source,
            message.status,
            *where,
            None,
            horizontal_accuracy=found.horizontal_accuracy,
            vertical_accuracy=found.vertical_accuracy,
            distance=found.distance,
            heading=found.heading,
            heading_accuracy=found.heading_accuracy,
            device=message.device,
        )
