"""Ground truth for cameras: what they may see, and the messages that say where it is.

No companion is on the link ``sight``. It has no faults, and its messages do not count as traffic of a flight.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from math import radians

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.config.companion import Moving, Obstacle
from companion.config.obstacles import MovingSphere, Post, Sphere
from mavlink_bridge.frames import FleetFrame, enu_to_ned, ned_to_enu, yaw_to_ned
from mavlink_bridge.messages import Source
from mavlink_bridge.network.simulated import Channel, Faults
from mavlink_bridge.node import Datagram, Node
from mavlink_bridge.wire.codec import Codec
from outrider.scenarios.footprints import without_walls
from outrider.scene.camera_view import NO_VIEW, Single, view_row
from outrider.simulation.paths import Array
from sitl.camera.occlusion import Ball, Blocks, Body, Column, Ground, Point
from sitl.camera.scene import LINK, Scene, truth
from sitl.node import Autopilot
from sitl.vehicle.config import VehicleConfig

CHANNEL = "sight"
DELAY_US = 20_000
"""µs: no less than the time between two exchanges of a flight's processes, and less than cameras take."""
_GROUND_M = 0.1
"""m below the origin: the ground is as far below it as a vehicle's centre is above the ground."""
_HERE = (0.0, 0.0, 0.0)


class Shown:
    """``node`` with a true position ``place`` (fleet-local ENU at a time, µs), which it shows as ``system``.

    It shows it in each of its steps.
    """

    def __init__(
        self, node: Node, system: int, place: Callable[[int], Array | None], fleet: FleetFrame
    ) -> None:
        self.name = node.name
        self._node, self._place, self._fleet = node, place, fleet
        self._source = Source(system, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._codec = Codec()

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Step the node, and show where it is."""
        said = self._node.step(now, inbox)
        place = self._place(now)
        if place is None:
            return said
        shown = truth(self._source, now, place, self._fleet)
        return [*said, Datagram(LINK, self._codec.encode(shown))]


def channel(members: Sequence[str]) -> Channel:
    """Return the channel between the nodes ``members``."""
    return Channel(CHANNEL, dict.fromkeys(members, LINK), Faults(delay=DELAY_US), counted=False)


def scene(
    target: int,
    obstacles: Sequence[Obstacle],
    moving: Sequence[Moving],
    others: Iterable[int],
    vehicle: VehicleConfig,
) -> Scene:
    """Return what the camera of one vehicle may see.

    ``target``: system id of the tracked object; ``others``: those of the other vehicles, which are of the
    type ``vehicle``, too.
    """
    ball = Ball(_HERE, 0.5 * vehicle.span)
    bodies: dict[int, Body] = dict.fromkeys(others, ball)
    for one in moving:
        if isinstance(one, MovingSphere):
            bodies[one.system] = Ball(_HERE, one.radius)
        else:
            bodies[one.system] = _column((0.0, 0.0), one.radius, one.height)
    return Scene(target, (Ground(_GROUND_M), *_fixed(obstacles)), bodies)


def view_of(autopilot: Autopilot) -> Single:
    """Return the row of the vehicle's camera: where it truly was and looked in its last image."""
    camera = autopilot.camera
    if camera is None or camera.last is None:
        return NO_VIEW
    view, detected = camera.last
    found = None if detected is None else ned_to_enu(detected)
    return view_row(ned_to_enu(view.place), view.attitude, camera.config.pinhole.fields, found)


def _fixed(obstacles: Sequence[Obstacle]) -> Iterator[Body]:
    """Yield the obstacles as bodies, all boxes and walls as one."""
    boxes = []
    for one in without_walls(obstacles):
        if isinstance(one, Sphere):
            east, north, up = one.at
            centre: Point = (north, east, -up)
            yield Ball(centre, one.radius)
        elif isinstance(one, Post):
            yield _column(one.at, one.radius, one.height)
        else:
            boxes.append(one)
    if boxes:
        centres = enu_to_ned([box.at for box in boxes])
        headings = [yaw_to_ned(radians(box.yaw_deg)) for box in boxes]
        turns = np.stack([np.cos(headings), np.sin(headings)], axis=1)
        yield Blocks(centres, 0.5 * np.array([box.size for box in boxes]), turns)


def _column(at: tuple[float, float], radius: float, height: float) -> Column:
    return Column((at[1], at[0]), radius, -height)
