"""Reader of a run's logs: plans, attitudes, modes, and the times at which other vehicles were received."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.committed import horizon_of
from companion.flight.vehicle import HEARTBEAT_LOST
from mavlink_bridge.errors import LogError, PlanWireError
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import Attitude, GlobalPosition, Heartbeat, Message, Source, Tunnel
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, unpack
from outrider.logs.flight_modes import is_armed, reported_mode
from outrider.runs import names
from outrider.scene.camera_view import NO_VIEW, CameraReceiver
from outrider.scene.snapshot import NO_PLAN, Array, Single, euler_attitude, padded

FRESH = 1_000_000
"""Time (µs) for which a plan is shown after its epoch, and an attitude after its message."""
_DECODED = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_TUNNEL,
    mavlink.MAVLINK_MSG_ID_CAMERA_FOV_STATUS,
    mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS,
}
_SWARM, _AUTOPILOT = names.LINK_NUMBERS["swarm"], names.LINK_NUMBERS["autopilot"]
_PROGRESS_RECORDS = 4096


class Record(NamedTuple):
    """Log data of one vehicle, by its own clock (Unix µs, rising).

    ``epochs`` belong to ``plans`` (KNOTS, 6), ``attitude_times`` to the attitudes (4,), FLU in ENU, and
    ``heartbeat_times`` to the heartbeats; attitudes and heartbeats are those of its autopilot. ``received``
    has the times of the positions received from each other vehicle. ``view_times`` belong to ``views`` (12,),
    the rows of its camera.
    """

    epochs: list[int]
    plans: list[Single]
    attitude_times: list[int]
    attitudes: list[Array]
    heartbeat_times: list[int]
    beats: list[Heartbeat]
    received: dict[int, list[int]]
    view_times: list[int]
    views: list[Single]

    def view(self, now: int) -> Single:
        """Return the row (12,) of the camera at ``now`` (µs); NaN if none is recent."""
        index = bisect_right(self.view_times, now) - 1
        return NO_VIEW if index < 0 or now - self.view_times[index] > FRESH else self.views[index]

    def plan(self, now: int) -> Single:
        """Return the plan flown at ``now`` (µs).

        It is NaN if no plan is recent, and while the autopilot reports to be disarmed.
        """
        index = bisect_right(self.epochs, now) - 1
        beat = self._beat(now)
        idle = beat is not None and not is_armed(beat)
        return NO_PLAN if idle or index < 0 or now - self.epochs[index] > FRESH else self.plans[index]

    def mode(self, now: int) -> str:
        """Return the mode that the autopilot reported at ``now`` (µs); empty if that is not known."""
        beat = self._beat(now)
        return "" if beat is None else reported_mode(beat)

    def attitude(self, now: int) -> Array | None:
        """Return the attitude reported at ``now`` (µs) or shortly before; None if there is none."""
        index = bisect_right(self.attitude_times, now) - 1
        return None if index < 0 or now - self.attitude_times[index] > FRESH else self.attitudes[index]

    def _beat(self, now: int) -> Heartbeat | None:
        index = bisect_right(self.heartbeat_times, now) - 1
        return None if index < 0 or now - self.heartbeat_times[index] > HEARTBEAT_LOST else self.beats[index]

    def age(self, now: int) -> float:
        """Return the age (s) of the oldest among the other vehicles' last positions; NaN before the first."""
        last = [times[index - 1] for times in self.received.values() if (index := bisect_right(times, now))]
        return 1e-6 * (now - min(last)) if last else float("nan")


def record(
    path: Path, owner: int, frame: FleetFrame, at: Callable[[int], None] = lambda _bytes: None
) -> Record:
    """Read the data of the vehicle ``owner`` from the log at ``path``, with positions in ``frame``.

    ``at`` is called with the number of bytes read. Missing or damaged records are omitted.
    """
    codec = Codec(lambda identifier, _system, _component: identifier in _DECODED)
    found, camera = Record([], [], [], [], [], [], {}, [], []), CameraReceiver()
    size = 0
    try:
        for number, one in enumerate(read_tlog(path)):
            size += 8 + len(one.frame)
            if number % _PROGRESS_RECORDS == 0:
                at(size)
            if one.link in (_SWARM, _AUTOPILOT):
                for message in codec.feed(one.frame, whole=True):
                    _take(found, owner, one.time, one.link, message)
                    if one.link == _AUTOPILOT:
                        _look(found, camera, owner, one.time, message, frame)
    except LogError:
        return found
    order = np.argsort(found.epochs, kind="stable").tolist()
    return found._replace(
        epochs=[found.epochs[i] for i in order],
        plans=[found.plans[i] for i in order],
        received={system: sorted(times) for system, times in found.received.items()},
    )


def _look(
    found: Record, camera: CameraReceiver, owner: int, time: int, message: Message, frame: FleetFrame
) -> None:
    late = found.view_times and time < found.view_times[-1]
    if message.source.system == owner and not late and camera.receive(message, frame):
        found.view_times.append(time)
        found.views.append(camera.row)


def _take(found: Record, owner: int, time: int, link: int, message: Message) -> None:
    system = message.source.system
    if isinstance(message, Attitude):
        if (
            system == owner
            and link == _AUTOPILOT
            and (not found.attitude_times or time >= found.attitude_times[-1])
        ):
            found.attitude_times.append(time)
            found.attitudes.append(euler_attitude(message.roll, message.pitch, message.yaw))
    elif isinstance(message, Heartbeat):
        own = message.source == Source(owner, mavlink.MAV_COMP_ID_AUTOPILOT1) and link == _AUTOPILOT
        if own and (not found.heartbeat_times or time >= found.heartbeat_times[-1]):
            found.heartbeat_times.append(time)
            found.beats.append(message)
    elif isinstance(message, GlobalPosition):
        if system != owner and link == _SWARM:
            found.received.setdefault(system, []).append(time)
    elif isinstance(message, Tunnel) and system == owner and message.payload_type == PAYLOAD_TYPE:
        try:
            plan = unpack(message.payload)
        except PlanWireError:
            return
        if not found.epochs or plan.epoch != found.epochs[-1]:
            found.epochs.append(plan.epoch)
            found.plans.append(padded(horizon_of(plan).knots[:, :6]))
