"""Backup node: flies a committed plan to its end when the companion that made it falls silent.

A vehicle that must keep to its plan needs a set-point every 20 ms. Without one its autopilot flies on along
the last set-point for a time-out and then brakes: beside its plan, and in the way of others that rely on it.
So a second, small program receives what its companion sends: plans on the swarm link, set-points on the
autopilot's link. While set-points arrive the backup node sends none. When they stop, and the autopilot is
still in the mode in which it follows set-points, the backup node sends those of the newest committed plan, to
the plan's end and for ``certified.backup_hover_us`` of hover; then the autopilot's own failsafe applies. A
companion that returns continues the same plan.

The backup node continues only a plan that is known to be flown: the companion's last set-point must agree
with the plan that the backup node holds, by its own clock and in its own local frame. A column is continued
at the height of that set-point, and only the horizontal distance counts, unless its plan still moves
vertically. Before any stored plan has begun, the earliest one counts if it never moves, and if a set-point
after its announcement agrees with its place. The backup node must start before the companion steers;
otherwise it waits for the next plan that has begun, or that never moves. It adds to the plan what the
companion adds (``plan_feedforward``, ``sent_compensation``). The companion's command to land, its farewell,
another mode, a disarmed vehicle or three seconds without a heartbeat discard all plans.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.committed import rest_time
from companion.avoidance.certified.fingerprint import fingerprint
from companion.backup.additions import SentAdditions
from companion.backup.announced_plans import AGREES_M, AnnouncedPlans
from companion.backup.last_farewell import LastFarewell
from companion.backup.links import BACKUP, Links
from companion.config import CompanionConfig
from companion.estimation.origins import Origins
from companion.flight.autopilots import Profile, is_guided
from companion.flight.autopilots.known import profile_of
from companion.flight.plan_feedforward import Additions
from companion.flight.setpoint import setpoint
from companion.flight.vehicle import HEARTBEAT_LOST
from companion.goals.heading import Yaw
from companion.telemetry.sharing import onboard_heartbeat
from companion.values.components import COMPONENT
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.frames import FleetFrame, LocalFrame
from mavlink_bridge.messages import (
    CommandLong,
    GpsGlobalOrigin,
    Heartbeat,
    Message,
    SetpointLocal,
    Source,
    Tunnel,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import unpack as unpack_statement
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN
from mavlink_bridge.wire.plan import unpack as unpack_plan
from mavlink_bridge.wire.signing import Signing

_SECOND_US = 1_000_000
_SILENT_PERIODS = 4
"""Number of set-point periods without a set-point after which the companion counts as silent."""


class BackupNode:
    """Backup ``Node`` beside the companion of ``system``, on the same clock.

    Links: ``autopilot``, ``swarm``. ``signing`` is the node's own instance, with the companion's key.
    ``finishes``: a farewell does not mean that the companion lands, because it may say it and fly its last
    plan to the end (``Companion.finish``).
    """

    def __init__(
        self,
        config: CompanionConfig,
        system: int,
        fleet: FleetFrame,
        signing: Signing | None = None,
        *,
        finishes: bool = False,
    ) -> None:
        self._finishes = finishes
        self.name = f"backup-{system}"
        self._config, self._fleet = config, fleet
        self._own = Source(system, BACKUP)
        self._links = Links(system, signing)
        self._plans = AnnouncedPlans(fleet.fingerprint, config.certified.epoch_us)
        self._additions = SentAdditions(config.tracking, self._plans)
        self._last_word = LastFarewell(self._own, config.certified, fingerprint(config, fleet))
        self._received: tuple[int, SetpointLocal] | None = None
        self._beat: tuple[int, Heartbeat] | None = None
        self._local: LocalFrame | None = None
        self._origins = Origins()
        self._next = self._next_beat = 0
        self._boot: int | None = None
        self.carried = 0
        """Number of set-points sent in place of the companion."""

    @property
    def steers(self) -> bool:
        """Whether the companion's last set-point agreed with its plan, and no other controller came since."""
        return self._received is not None

    def rests(self, now: int, settling: int) -> bool:
        """Return whether no plan is flown, or it has been at rest for ``settling`` at ``now`` (µs)."""
        horizon = self._plans.horizon(now) if self._received is not None else None
        return horizon is None or now >= rest_time(horizon) + settling

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Receive messages; while the companion is silent, send the set-point of its plan at ``now`` (µs)."""
        self.receive(now, self._links.decode(now, inbox))
        return self.advance(now)

    def receive(self, now: int, messages: Sequence[Message]) -> None:
        """Receive ``messages`` that ``accepts`` accepts, decoded and checked elsewhere.

        ``now`` (µs): time at which the companion sent its own. Whether a set-point agrees with its plan is
        judged at that time.
        """
        for message in messages:
            self._receive(now, message)

    def advance(self, now: int) -> list[Datagram]:
        """Do a step at ``now`` (µs); signatures continue after the newest stamp of ``signing``."""
        self._boot = now if self._boot is None else self._boot
        beat = self._heartbeat(now)
        profile = self._profile(now)
        if profile is None:
            # Another controller steers the vehicle, or may do so: earlier plans are no longer flown.
            self._forget()
        if now < self._next or profile is None or self._local is None or self._received is None:
            return beat
        period = self._config.rates.setpoint_us
        since, last = self._received
        if now - since <= _SILENT_PERIODS * period:
            return beat
        horizon = self._plans.horizon(now)
        if horizon is None or now > horizon.end + self._config.certified.backup_hover_us:
            return beat
        self._next = now + period
        self.carried += 1
        # The target is not known here, so the yaw stays at the companion's last one.
        yaw = Yaw(self._local.yaw_to_fleet(last.yaw), 0.0, 0.0)
        time = now + self._config.setpoint_lead_us
        added = Additions()
        if self._config.tracking.compensate:
            added = self._additions.at(time, horizon.at(time), profile.loop)
        message = setpoint(
            time,
            now - self._boot,
            horizon,
            yaw,
            self._local,
            self._own,
            profile.setpoint_mask,
            added.acceleration,
            added=added.velocity,
        )
        return [*beat, self._links.encode("autopilot", message)]

    def farewell(self, now: int) -> list[Message]:
        """Return the newest plan, and the statement that it is the companion's last one.

        To be sent on the swarm link once the companion's process has ended. Nothing without a flown plan, and
        before the newest one has begun at ``now`` (µs), see ``LastFarewell``.
        """
        plan = self._plans.newest
        return [] if self._received is None or plan is None else self._last_word.messages(now, plan)

    def hear(self, now: int, messages: Sequence[Message]) -> None:
        """Take note of the others' plans among ``messages``, received after the companion's end.

        The farewell names the newest of each, so that it also answers who has begun anew since. ``now`` (µs):
        time of the fleet.
        """
        for message in messages:
            if not isinstance(message, Tunnel) or message.payload_type != PLAN:
                continue
            system, component = message.source
            if component != COMPONENT or system == self._own.system:
                continue
            try:
                plan = unpack_plan(message.payload)
            except PlanWireError:
                continue
            if self._plans.fits(now, plan):
                self._last_word.hear(system, plan)

    def _heartbeat(self, now: int) -> list[Datagram]:
        """Return a heartbeat once a second: routers learn the route from it, and operators see the node."""
        if now < self._next_beat:
            return []
        self._next_beat = now + _SECOND_US
        beat = onboard_heartbeat(self._own)
        return [self._links.encode("autopilot", beat)]

    def _receive(self, now: int, message: Message) -> None:
        """Receive a message of the companion or of its autopilot."""
        match message:
            case Heartbeat():
                self._beat = now, message
            case GpsGlobalOrigin() if self._origins.counts(now, message):
                self._local = self._fleet.local(message.latitude, message.longitude, message.altitude)
            case SetpointLocal():
                self._received = (now, message) if self._agrees(now, message) else None
                self._learn(now, message)
            case CommandLong() if message.command == mavlink.MAV_CMD_NAV_LAND:
                self._forget()
            case Tunnel():
                self._store(now, message)
            case _:
                pass

    def _store(self, now: int, message: Tunnel) -> None:
        """Store a plan of the companion; discard all plans on a farewell, after which the companion lands."""
        try:
            if message.payload_type == AGREEMENTS:
                statement = unpack_statement(message.payload)
                self._last_word.receive(statement)
                if statement.farewell and not self._finishes:
                    self._forget()
            elif message.payload_type == PLAN and self._plans.add(now, unpack_plan(message.payload)):
                # What was observed rests on another plan at that time.
                self._additions.forget()
        except PlanWireError:
            return

    def _agrees(self, now: int, message: SetpointLocal) -> bool:
        """Return whether the companion's set-point agrees with the stored plan; False without a plan."""
        if self._local is None:
            return False
        self._plans.height = float(self._local.position_to_fleet(message.position)[2])
        horizon = self._plans.horizon(now)
        if horizon is None:
            return False
        planned = self._local.position_to_local(horizon.at(now + self._config.setpoint_lead_us).position)
        off = planned - np.array(message.position)
        # Written so that a NaN does not agree.
        return bool(off @ off <= AGREES_M**2)

    def _learn(self, now: int, message: SetpointLocal) -> None:
        """Observe what the companion's set-point, if it agrees with the plan, adds to the acceleration."""
        profile = self._profile(now)
        if not self._config.tracking.compensate or self._received is None:
            return
        if profile is not None and self._local is not None:
            sent = self._local.velocity_to_fleet(message.acceleration)
            self._additions.observe(now, now + self._config.setpoint_lead_us, sent, profile.loop)

    def _forget(self) -> None:
        """Discard all plans and the last set-point; nothing is sent until both have been received again."""
        self._plans.clear()
        self._received = None
        self._additions.forget()

    def _profile(self, now: int) -> Profile | None:
        """Return the autopilot's profile; None unless it is connected, armed and follows set-points."""
        if self._beat is None or now - self._beat[0] > HEARTBEAT_LOST:
            return None
        beat = self._beat[1]
        profile = profile_of(beat)
        armed = beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        steers = profile is not None and armed and is_guided(profile, beat)
        return profile if steers else None
