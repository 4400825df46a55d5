"""Commands to a camera and its gimbal, as COMMAND_LONG (76) or COMMAND_INT (75)."""

from __future__ import annotations

import math
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    LONGEST_INTERVAL,
    CameraInformation,
    CommandAck,
    CommandInt,
    CommandLong,
    Message,
    MessageInterval,
)
from sitl.camera.camera import Camera

_ACCEPTED: Final[int] = mavlink.MAV_RESULT_ACCEPTED
_DENIED: Final[int] = mavlink.MAV_RESULT_DENIED
_UNSUPPORTED: Final[int] = mavlink.MAV_RESULT_UNSUPPORTED
_INFORMATION: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION
_SENSOR_WIDTH_MM: Final = 6.4
_SHORTEST_US: Final = 16_000


class CameraService:
    """Service of ``camera``: what it is, how often it reports, where its gimbal points, whether it tracks.

    A camera answers commands to its component. To commands for all components it answers only those that it
    supports, so that the autopilot's answer is not contradicted.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera = camera

    def handle(self, message: CommandLong | CommandInt, stamp: int) -> list[Message]:
        """Execute a command that arrived at ``stamp`` (µs, the autopilot's clock); return the answers."""
        camera = self._camera
        source = camera.source
        if message.target_system not in (0, source.system):
            return []
        if message.target_component == camera.gimbal.component and camera.mount.on_gimbal:
            source = camera.gimbal
        elif message.target_component not in (0, source.component):
            return []
        answers: list[Message] = []
        result = self._obey(message, answers, stamp)
        if result == _UNSUPPORTED and message.target_component == 0:
            return []
        return [CommandAck(source, message.command, result, 0, 0, *message.source), *answers]

    def _obey(self, message: CommandLong | CommandInt, answers: list[Message], stamp: int) -> int:
        first, second = message.params[:2]
        camera = self._camera
        match message.command:
            case mavlink.MAV_CMD_REQUEST_MESSAGE if first == _INFORMATION:
                answers.append(information(camera, stamp))
            case mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION if first == 1.0:
                answers.append(information(camera, stamp))
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL if first == self._stream:
                return self._set_interval(second)
            case mavlink.MAV_CMD_GET_MESSAGE_INTERVAL if first == self._stream:
                interval = camera.interval if camera.tracking else -1
                answers.append(MessageInterval(camera.source, interval, self._stream))
            case mavlink.MAV_CMD_CAMERA_TRACK_POINT | mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE:
                camera.tracking = True
            case mavlink.MAV_CMD_CAMERA_STOP_TRACKING:
                camera.tracking = False
            case mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW if math.isfinite(first):
                # MAVLink counts pitch upwards; the gimbal's yaw is the vehicle's.
                return _ACCEPTED if camera.mount.turn(math.radians(first)) else _UNSUPPORTED
            case _:
                return _UNSUPPORTED
        return _ACCEPTED

    @property
    def _stream(self) -> int:
        """Message that the camera's images lead to."""
        if self._camera.config.speaks == "image":
            return int(mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_IMAGE_STATUS)
        return int(mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS)

    def _set_interval(self, interval: float) -> int:
        camera = self._camera
        if not math.isfinite(interval) or 0.0 < interval < _SHORTEST_US:
            return _DENIED
        camera.tracking = interval >= 0.0
        if camera.tracking:
            camera.interval = min(round(interval), LONGEST_INTERVAL) or camera.config.period
        return _ACCEPTED


def information(camera: Camera, stamp: int) -> CameraInformation:
    """Return CAMERA_INFORMATION (259) at ``stamp`` (µs since boot), with the optics of the pinhole."""
    config = camera.config
    width, height = config.resolution
    pixel = _SENSOR_WIDTH_MM / width
    abilities = mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_POINT | mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_RECTANGLE
    if config.speaks == "geo":
        abilities |= mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_GEO_STATUS
    return CameraInformation(
        camera.source,
        stamp,
        "outrider",
        "simulated camera",
        1,
        config.pinhole.focal * pixel,
        (_SENSOR_WIDTH_MM, height * pixel),
        (width, height),
        abilities,
        gimbal=camera.gimbal.component if camera.mount.on_gimbal else 0,
    )
