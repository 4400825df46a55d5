"""Messages to the others: position and horizon on the swarm link, a heartbeat also to the autopilot.

The position (GLOBAL_POSITION_INT) is always sent in addition to the horizon, because every MAVLink receiver
understands it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.estimation.fused_target import Outgoing
from companion.values.horizon import Array, Horizon
from companion.world import View
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.frames import FleetFrame, yaw_to_ned
from mavlink_bridge.messages import (
    CameraFovStatus,
    CameraTrackingGeo,
    GlobalPosition,
    Heartbeat,
    Message,
    Source,
    Tunnel,
)
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, packed
from mavlink_bridge.wire.uncertainty import PAYLOAD_TYPE as DOUBT
from mavlink_bridge.wire.uncertainty import pack as pack_doubt

_SECOND = 1_000_000
_CLEAR_US = 3_000_000
"""µs after the last position uncertainty above 0 during which 0 is sent, to end the report."""


def onboard_heartbeat(own: Source) -> Heartbeat:
    """Return HEARTBEAT (0) of an active onboard computer, which is no autopilot."""
    kind, autopilot = mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID
    return Heartbeat(own, kind, autopilot, 0, 0, mavlink.MAV_STATE_ACTIVE)


class Shared(NamedTuple):
    """Messages to send, by link."""

    autopilot: Sequence[Message]
    swarm: Sequence[Message]


NOTHING_SHARED = Shared((), ())


class Sharing:
    """Creates the messages to share; each kind has its own period."""

    def __init__(self, config: CompanionConfig, own: Source, fleet: FleetFrame) -> None:
        self._config = config
        self._own = own
        self._fleet = fleet
        self._boot: int | None = None
        self._next = [0, 0, 0]
        self.next_due = 0
        """Time (µs) at which the next message may be due; 0 before the first call of ``due``."""
        self._doubted: int | None = None

    def due(self, now: int, view: View, horizon: Horizon | None, doubt: float = 0.0) -> Shared:
        """Return the messages that are due at ``now`` (µs).

        ``horizon``: the flown one; without it, or without ``shares_plan``, no plan is sent. A position is
        sent only while the own state is fresh. ``doubt``: how far (m) the vehicle may be from that position.
        """
        if self._boot is None:
            self._boot = now
            self._next = [now, now, now + self._config.rates.plan_after_us]
        rates = self._config.rates
        autopilot: list[Message] = []
        swarm: list[Message] = []
        if self._passes(0, now, _SECOND):
            beat = onboard_heartbeat(self._own)
            autopilot.append(beat)
            swarm.append(beat)
        fresh = view.own is not None and view.own.age <= self._config.guard.own_stale_us
        if self._passes(1, now, rates.state_us) and fresh:
            swarm.append(self._position(now - self._boot, view))
            if doubt > 0.0:
                self._doubted = now
            if self._doubted is not None and now - self._doubted <= _CLEAR_US:
                # GLOBAL_POSITION_INT has no field for the uncertainty.
                swarm.append(Tunnel(self._own, 0, 0, DOUBT, pack_doubt(doubt)))
        if self._passes(2, now, rates.plan_us) and horizon is not None and self._config.shares_plan:
            plan = plan_message(horizon, self._own, self._fleet)
            if plan is not None:
                swarm.append(plan)
        self.next_due = min(self._next)
        return Shared(autopilot, swarm)

    def detections(self, own: Sequence[Outgoing]) -> list[Message]:
        """Return the messages that forward ``own`` detections: time of the image and camera, and detection.

        Their time is on the clock of GLOBAL_POSITION_INT. One from before the first message is not sent.
        """
        boot, messages = self._boot, list[Message]()
        if boot is None:
            return []
        for time, view, message in own:
            if time < boot:
                continue
            messages += forwarded(self._own, time - boot, view, message)
        return messages

    def _passes(self, kind: int, now: int, period: int) -> bool:
        if now < self._next[kind]:
            return False
        self._next[kind] += period * (1 + (now - self._next[kind]) // period)
        return True

    def _position(self, since_boot: int, view: View) -> GlobalPosition:
        if view.own is None:
            raise ValueError("no own state to share")
        yaw = None if view.yaw is None else yaw_to_ned(view.yaw)
        return position_message(self._own, since_boot, self._fleet, view.own.position, view.own.velocity, yaw)


def forwarded(
    own: Source, since_boot: int, view: CameraFovStatus, message: CameraTrackingGeo
) -> tuple[Message, Message]:
    """Return the messages by which ``own`` forwards a detection of an image at ``since_boot`` (µs).

    Attitude and angles of view are not forwarded: MAVLink 2 leaves out their zeros at the end.
    """
    seen = CameraFovStatus(own, since_boot, view.place, None, (0.0, 0.0, 0.0, 0.0), 0.0, 0.0)
    return seen, message._replace(source=own)


def position_message(
    source: Source, since_boot: int, fleet: FleetFrame, position: Array, velocity: Array, yaw: float | None
) -> GlobalPosition:
    """Return the GLOBAL_POSITION_INT of ``source``.

    Position (3,) m and velocity (3,) m/s are fleet-local ENU; ``yaw`` is NED (rad); ``since_boot`` is in µs.
    """
    latitude, longitude, altitude = fleet.to_geodetic(position)
    east, north, up = velocity.tolist()
    return GlobalPosition(
        source, since_boot, latitude, longitude, altitude, float(position[2]), (north, east, -up), yaw
    )


def plan_message(horizon: Horizon, source: Source, fleet: FleetFrame) -> Tunnel | None:
    """Return the TUNNEL message of ``source`` with this horizon.

    Returns None if the horizon does not fit the wire format; neighbours then receive the position alone.
    """
    knots = horizon.knots
    try:
        payload = packed(
            horizon.epoch, horizon.dt, knots[0, 0:3], knots[0, 3:6], knots[:-1, 6:9], fleet.fingerprint
        )
    except PlanWireError:
        return None
    return Tunnel(source, 0, 0, PAYLOAD_TYPE, payload)
