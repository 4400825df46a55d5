"""Source of vehicles that are observed through their MAVLink messages. Nothing is ever sent."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.committed import horizon_of
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.frames import FleetFrame, ned_to_enu, yaw_to_enu
from mavlink_bridge.links.link import Link
from mavlink_bridge.messages import Attitude, GlobalPosition, Heartbeat, Message, NamedValue, Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, unpack
from outrider.logs.flight_modes import is_armed, reported_mode
from outrider.scene.camera_view import NO_VIEW, CameraReceiver
from outrider.scene.scene import LEAST_REACH, Scene
from outrider.scene.snapshot import NO_PLAN, Array, Single, Snapshot, State, euler_attitude, padded
from outrider.scene.view_commands import ViewCommands

LOST, EXTRAPOLATION_S, FRESH = 10.0, 0.5, 1.0
"""Limits of age (s).

A vehicle without a GLOBAL_POSITION_INT for LOST is no longer drawn; its position is extrapolated with its
velocity for EXTRAPOLATION_S; attitudes and plans are valid for FRESH.
"""
PICTURE, NEW_SCENE = 0.04, 1.0
"""Shortest time (s) between two snapshots, and between two scenes."""
MOST = 250
_ACCEPTED = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT,
    mavlink.MAVLINK_MSG_ID_TUNNEL,
    mavlink.MAVLINK_MSG_ID_CAMERA_FOV_STATUS,
    mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS,
}
_SAMPLES = 101


class _Fix(NamedTuple):
    at: float
    place: Array
    velocity: Array
    yaw: float | None


class _Received:
    """Last data received from one system. Times are wall times in s."""

    def __init__(self, fix: _Fix) -> None:
        self.fix = fix
        self.attitude_times = -np.inf
        self.attitude: Array | None = None
        self.planned = -np.inf
        self.plan: Single = NO_PLAN
        self.beat: Heartbeat | None = None
        self.plan_ms = float("nan")
        self.held: int | None = None
        self.camera = CameraReceiver()
        self.seen = -np.inf

    def view(self, wall: float) -> Single:
        """Return the row (12,) of its camera; NaN if it is out of date."""
        return self.camera.row if wall - self.seen < FRESH else NO_VIEW

    def flown(self, wall: float) -> Single:
        """Return the plan (KNOTS, 6); NaN if it is out of date or the vehicle has reported to be disarmed."""
        idle = self.beat is not None and not is_armed(self.beat)
        return NO_PLAN if idle or wall - self.planned >= FRESH else self.plan

    @property
    def mode(self) -> str:
        """Mode reported by the autopilot; empty before the first report."""
        return "" if self.beat is None else reported_mode(self.beat)


class Listener:
    """``Source`` that receives from ``links``.

    ``whole`` states for each link whether it delivers whole datagrams. ``target`` is the system id of the
    escorted target.
    """

    span: tuple[float, float] | None = None
    begin = ViewCommands()

    def __init__(self, links: Sequence[Link], whole: Sequence[bool], target: int, hint: str) -> None:
        self._links = [
            (link, datagrams, Codec(lambda identifier, _system, _component: identifier in _ACCEPTED))
            for link, datagrams in zip(links, whole, strict=True)
        ]
        self._target = target
        self.hint = hint
        self._frame: FleetFrame | None = None
        self._received: dict[int, _Received] = {}
        self._offsets: deque[Array] = deque(maxlen=_SAMPLES)
        self._step: float | None = None
        self._certified = False
        self._shown: tuple[tuple[int, ...], bool] = (), False
        self._scene_at = self._begun = self._next = -np.inf

    def poll(self, wall: float) -> Sequence[Scene | Snapshot]:
        """Return a scene after a new vehicle or the first agreements, and a snapshot once in PICTURE."""
        for link, datagrams, codec in self._links:
            for data in link.receive():
                for message in codec.feed(data, whole=datagrams):
                    self._receive(wall, message)
        systems = tuple(sorted(system for system in self._received if system != self._target))
        if not systems or wall < self._next:
            return ()
        self._next = wall + PICTURE
        found: list[Scene | Snapshot] = []
        new = systems, self._certified
        if new != self._shown and wall - self._scene_at > NEW_SCENE:
            self._shown, self._scene_at = new, wall
            self._begun = wall if not np.isfinite(self._begun) else self._begun
            found.append(self._scene(systems))
        if self._shown[0]:
            found.append(self._moment(wall))
        return found

    def command(self, commands: ViewCommands, sought: float | None) -> None:
        """Ignore view commands, because nothing is sent."""

    def _receive(self, wall: float, message: Message) -> None:
        system, component = message.source
        if isinstance(message, GlobalPosition):
            self._place(wall, system, component, message)
            return
        received = self._received.get(system)
        if received is None:
            return
        if self._frame is not None and received.camera.receive(message, self._frame):
            received.seen = wall
        elif isinstance(message, Attitude):
            received.attitude_times = wall
            received.attitude = euler_attitude(message.roll, message.pitch, message.yaw)
        elif isinstance(message, Heartbeat):
            if component == mavlink.MAV_COMP_ID_AUTOPILOT1:
                received.beat = message
        elif isinstance(message, NamedValue):
            if message.name == "plan_ms":
                received.plan_ms = message.value
            elif message.name == "held":
                received.held = int(message.value)
        elif isinstance(message, Tunnel):
            self._tunnel(wall, received, message)

    def _place(self, wall: float, system: int, component: int, said: GlobalPosition) -> None:
        if self._frame is None:
            self._frame = FleetFrame(said.latitude, said.longitude, said.altitude - said.relative_altitude)
        velocity = ned_to_enu(said.velocity_ned)
        place = self._frame.to_enu(said.latitude, said.longitude, said.altitude)
        fix = _Fix(wall, place, velocity, None if said.yaw is None else yaw_to_enu(said.yaw))
        received = self._received.get(system)
        if received is not None:
            received.fix = fix
        elif len(self._received) < MOST:
            self._received[system] = _Received(fix)

    def _tunnel(self, wall: float, received: _Received, said: Tunnel) -> None:
        """Store a plan, shifted into the fleet frame.

        The origin of the plan's frame is unknown: the median offset between vehicles and the first points of
        their plans gives it.
        """
        self._certified |= said.payload_type == AGREEMENTS
        if said.payload_type != PAYLOAD_TYPE:
            return
        try:
            plan = unpack(said.payload)
        except PlanWireError:
            return
        knots = horizon_of(plan).knots[:, :6].copy()
        self._step = 1e-6 * plan.dt
        self._offsets.append(received.fix.place - knots[0, :3])
        knots[:, :3] += np.median(np.array(self._offsets), axis=0)
        received.planned, received.plan = wall, padded(knots)

    def _scene(self, systems: tuple[int, ...]) -> Scene:
        places = np.array([self._received[system].fix.place for system in systems])
        low, high = places.min(axis=0), places.max(axis=0)
        x, y, z = (0.5 * (low + high)).tolist()
        return Scene(
            "listening",
            systems,
            len(systems),
            centre=(x, y, z),
            reach=max(0.75 * float(np.linalg.norm(high - low)), 2.0 * LEAST_REACH),
            follows=True,
            step_s=self._step if self._certified else None,
        )

    def _moment(self, wall: float) -> Snapshot:
        shown = [self._received[system] for system in self._shown[0]]
        target = self._received.get(self._target)
        return Snapshot(
            wall - self._begun,
            "live",
            np.array([_carried(one.fix, wall) for one in shown], np.float32),
            np.array([_turned(one, wall) for one in shown], np.float32),
            np.array([one.flown(wall) for one in shown]),
            np.array(np.full(3, np.nan) if target is None else _carried(target.fix, wall), np.float32),
            np.empty((0, 3), np.float32),
            tuple(State(one.mode, wall - one.fix.at, one.plan_ms, one.held) for one in shown),
            np.array([one.view(wall) for one in shown]),
        )


def _carried(fix: _Fix, wall: float) -> Array:
    """Return the extrapolated position (3,); NaN if the last position is older than LOST."""
    age = wall - fix.at
    if age > LOST:
        return np.full(3, np.nan)
    place: Array = fix.place + min(age, EXTRAPOLATION_S) * fix.velocity
    return place


def _turned(received: _Received, wall: float) -> Array:
    if received.attitude is not None and wall - received.attitude_times < FRESH:
        return received.attitude
    half = 0.5 * (received.fix.yaw or 0.0)
    return np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
