"""Camera component of a vehicle: it takes images on a grid, and says ``latency`` later what was in them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Heartbeat, HilState, Message, Source
from mavlink_bridge.pinhole import Extent, foot, rotated, upward
from sitl.camera.detector import Detector, Draws, View
from sitl.camera.mount import Mount
from sitl.camera.occlusion import Point
from sitl.camera.reports import Pose, fov_status, geo_status, gimbal_attitude, image_status
from sitl.camera.scene import Scene, Sightings
from sitl.estimation.sensors import Estimate
from sitl.values.attitudes import quaternion
from sitl.values.camera import CameraConfig
from sitl.values.origin import Origin
from sitl.vehicle.multirotor import VehicleState

# Separates these random numbers from those of the vehicle's other parts, which have the same seeds.
_RNG_STREAM_ID: Final = 0x43
_BEAT_US: Final = 1_000_000
_SEARCH_US: Final = 500_000
# A gimbal that follows returns to its first pitch after this time without a detection: it may have followed a
# false one, and the target may be out of view since.


class Image(NamedTuple):
    """Image that is not developed yet.

    ``time`` (µs since boot) by the simulation, in ``pose`` by the autopilot's clock; ``view`` is the truth.
    """

    time: int
    view: View
    pose: Pose
    draws: Draws


class Camera:
    """Camera of the vehicle ``system``; it takes images while ``tracking``, at ``interval`` (µs).

    ``last`` is the view of the last developed image and the detected place (m, site NED), for pictures.
    """

    def __init__(
        self, config: CameraConfig, scene: Scene, origin: Origin, site: FleetFrame, seed: int, system: int
    ) -> None:
        self.config = config
        self.source = Source(system, mavlink.MAV_COMP_ID_CAMERA)
        self.gimbal = Source(system, mavlink.MAV_COMP_ID_GIMBAL)
        self.mount = Mount(config.mount)
        self.sightings = Sightings(scene, site)
        self.tracking = True
        self.interval = config.period
        self.last: tuple[View, Point | None] | None = None
        self._detector = Detector(config)
        self._origin = origin
        self._random = np.random.default_rng([seed, system, _RNG_STREAM_ID])
        self._next = 0
        self._beat = 0
        self._then = 0
        self._waiting: deque[Image] = deque()
        self._turned: list[Message] = []
        self._seen = 0

    def receive(self, message: HilState) -> None:
        """Receive the true place of a body."""
        self.sightings.receive(message)

    def step(
        self, now: int, boot: int, state: VehicleState, estimate: Callable[[], Estimate], stamp: int
    ) -> None:
        """Take an image if one is due at ``now`` (µs since boot).

        ``boot`` (µs): time of the boot, on the clock of the sightings; ``state`` and ``estimate`` are those
        of ``now``, which is ``stamp`` on the autopilot's clock.
        """
        self.mount.advance(1e-6 * (now - self._then))
        self._then = now
        if now < self._next or not self.tracking:
            return
        self._next += self.interval * ((now - self._next) // self.interval + 1)
        true = _attitude(state)
        place = np.add(state.position, self.mount.offset(true))
        view = View(_point(place), self.mount.attitude(true))
        found = estimate()
        believed = quaternion(found.roll, found.pitch, found.yaw)
        where = _point(np.add(found.position, self.mount.offset(believed)))
        pose = Pose(stamp, where, self.mount.attitude(believed))
        if self.mount.on_gimbal:
            self._turned.append(gimbal_attitude(self.gimbal, pose))
        self._waiting.append(Image(now + boot, view, pose, Draws.of(self._random)))

    def messages(self, now: int, boot: int) -> list[Message]:
        """Return the messages due at ``now`` (µs since boot).

        They are the gimbal's attitude as an image is taken, heartbeats, and those of developed images.
        """
        said, self._turned = self._turned, []
        if now >= self._beat:
            self._beat += _BEAT_US * ((now - self._beat) // _BEAT_US + 1)
            said += self._heartbeats()
        while self._waiting and self._waiting[0].time + self.config.latency <= now + boot:
            said += self._developed(self._waiting.popleft())
        return said

    def _heartbeats(self) -> list[Message]:
        invalid, active = mavlink.MAV_AUTOPILOT_INVALID, mavlink.MAV_STATE_ACTIVE
        beats: list[Message] = [Heartbeat(self.source, mavlink.MAV_TYPE_CAMERA, invalid, 0, 0, active)]
        if self.mount.on_gimbal:
            beats.append(Heartbeat(self.gimbal, mavlink.MAV_TYPE_GIMBAL, invalid, 0, 0, active))
        return beats

    def _developed(self, image: Image) -> list[Message]:
        config, camera, geodetic = self.config, self._detector.camera, self._origin.geodetic
        sightings, target = self.sightings, self.sightings.scene.target
        place = None if target is None else sightings.place(target, image.time)
        seen = self._detector.detect(image.view, place, sightings.bodies(image.time), image.draws)
        said: list[Message] = []
        if config.fov_status:
            said.append(fov_status(self.source, camera, image.pose, geodetic))
        self.last = image.view, None
        if seen is None:
            if image.time - self._seen >= _SEARCH_US:
                self.mount.search()
            return said
        self._seen = image.time
        self._aim(image.view, seen)
        if config.speaks == "image":
            said.append(image_status(self.source, config, camera, seen))
        elif (found := geo_status(self.source, config, camera, seen, image.pose, geodetic)) is not None:
            said.append(found)
        return said

    def _aim(self, view: View, seen: Extent) -> None:
        """Turn a gimbal that follows to the middle of what was detected, and note its place."""
        camera = self._detector.camera
        column, row = seen.column, 0.5 * (seen.top + seen.foot)
        north, east, down = rotated(view.attitude, camera.ray(column, row))
        self.mount.follow(math.atan2(-down, math.hypot(north, east)))
        low = foot(camera, seen, upward(view.attitude), self.config.object.height)
        if low is not None:
            self.last = view, _point(np.add(view.place, rotated(view.attitude, low)))


def _attitude(state: VehicleState) -> tuple[float, float, float, float]:
    w, x, y, z = state.attitude.tolist()
    return w, x, y, z


def _point(place: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Point:
    x, y, z = place.tolist()
    return x, y, z
