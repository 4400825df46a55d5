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
at the height of that set-point, and only the horizontal distance counts. The backup node must start before
the companion steers; otherwise it waits for the next plan. It adds to the plan what the companion adds
(``plan_feedforward``, ``sent_compensation``). The companion's command to land, its farewell, another mode, a
disarmed vehicle or three seconds without a heartbeat discard all plans.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.committed import carried_on, horizon_of, rest_time, rests
from companion.avoidance.certified.fingerprint import fingerprint
from companion.config import CompanionConfig
from companion.errors import CompanionError
from companion.estimation.origins import Origins
from companion.flight.autopilots import Profile, is_guided
from companion.flight.autopilots.known import profile_of
from companion.flight.plan_feedforward import MAX_PAUSE_US, USUAL_DRAG, Additions, PlanFeedforward
from companion.flight.sent_compensation import SentCompensation
from companion.flight.setpoint import setpoint
from companion.flight.vehicle import HEARTBEAT_LOST
from companion.goals.heading import Yaw
from companion.telemetry.sharing import onboard_heartbeat
from companion.values.components import COMPONENT
from companion.values.horizon import Horizon, Motion
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
from mavlink_bridge.wire.agreements import Entry, Statement, in_messages
from mavlink_bridge.wire.agreements import pack as pack_statement
from mavlink_bridge.wire.agreements import unpack as unpack_statement
from mavlink_bridge.wire.codec import Accept, Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN
from mavlink_bridge.wire.plan import WirePlan
from mavlink_bridge.wire.plan import pack as pack_plan
from mavlink_bridge.wire.plan import unpack as unpack_plan
from mavlink_bridge.wire.signing import Signing

BACKUP: Final[int] = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
"""Component id of the backup node."""
_MAX_DEVIATION_M = 0.3
"""Largest distance at which a set-point agrees with the plan; it covers the flight during its delay."""
_MAX_EPOCHS_AWAY = 4
"""Largest time, in epochs, between now and the beginning of a plan that is accepted."""
_SECOND_US = 1_000_000
_SILENT_PERIODS = 4
"""Number of set-point periods without a set-point after which the companion counts as silent."""
_AUTOPILOT_IDS = frozenset((mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN))
_COMPANION_IDS = frozenset(
    (mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED, mavlink.MAVLINK_MSG_ID_COMMAND_LONG)
)
"""Message ids that are received on the autopilot's link, by sender."""
LINKS: Final = ("autopilot", "swarm")
"""The links of a backup node."""


def accepts(link: str, system: int) -> Accept:
    """Return the header filter of ``link`` for the backup node of ``system``."""
    if link == "swarm":
        return lambda identifier, sender, component: (
            (sender, component) == (system, COMPONENT) and identifier == mavlink.MAVLINK_MSG_ID_TUNNEL
        )
    return lambda identifier, sender, component: (
        sender == system
        and (
            (component == mavlink.MAV_COMP_ID_AUTOPILOT1 and identifier in _AUTOPILOT_IDS)
            or (component == COMPONENT and identifier in _COMPANION_IDS)
        )
    )


def accepts_peers(system: int) -> Accept:
    """Return the header filter of the swarm link for ``BackupNode.hear`` of ``system``."""
    return lambda identifier, sender, component: (
        identifier == mavlink.MAVLINK_MSG_ID_TUNNEL and sender != system and component == COMPONENT
    )


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
        self._codecs = {link: Codec(accepts(link, system), signing) for link in LINKS}
        self._signing = signing
        self._plans: dict[int, WirePlan] = {}
        self._cached_horizon: tuple[WirePlan, float | None, Horizon] | None = None
        self._received: tuple[int, SetpointLocal] | None = None
        self._height: float | None = None
        self._beat: tuple[int, Heartbeat] | None = None
        self._compensation, self._feedforward = SentCompensation(), PlanFeedforward()
        self._local: LocalFrame | None = None
        self._origins = Origins()
        self._next = self._next_beat = 0
        self._boot: int | None = None
        self._since = 0
        self._entries: dict[int, Entry] = {}
        self.carried = 0
        """Number of set-points sent in place of the companion."""

    @property
    def steers(self) -> bool:
        """Whether the companion's last set-point agreed with its plan, and no other controller came since."""
        return self._received is not None

    def rests(self, now: int, settling: int) -> bool:
        """Return whether no plan is flown, or it has been at rest for ``settling`` at ``now`` (µs)."""
        horizon = self._horizon(now) if self._received is not None else None
        return horizon is None or now >= rest_time(horizon) + settling

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Receive messages; while the companion is silent, send the set-point of its plan at ``now`` (µs)."""
        if self._signing is not None:
            self._signing.present(now)
        messages = [message for link, data in inbox for message in self._codecs[link].feed(data, whole=True)]
        self.receive(now, messages)
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
        horizon = self._horizon(now)
        if horizon is None or now > horizon.end + self._config.certified.backup_hover_us:
            return beat
        self._next = now + period
        self.carried += 1
        # The target is not known here, so the yaw stays at the companion's last one.
        yaw = Yaw(self._local.yaw_to_fleet(last.yaw), 0.0, 0.0)
        time = now + self._config.setpoint_lead_us
        added = self._added(time, horizon.at(time), profile)
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
        return [*beat, Datagram("autopilot", self._codecs["autopilot"].encode(message))]

    def farewell(self, now: int) -> list[Message]:
        """Return the newest plan, and the statement that it is the companion's last one.

        To be sent on the swarm link once the companion's process has ended. Nothing without a flown plan, and
        before the newest one has begun at ``now`` (µs) by the clocks of all. The plan is carried on, because
        old plans are not accepted; the entries are the last ones of the companion, by which the others know
        that this farewell answers their own beginning, and name the newest plans that ``hear`` was given.
        """
        if self._received is None or not self._plans:
            return []
        plan, certified = self._plans[max(self._plans)], self._config.certified
        begun = now - 2 * certified.clock_us
        if begun < plan.epoch:
            return []
        plan = carried_on(plan, (begun - plan.epoch) // certified.epoch_us * certified.knots)
        entries = tuple(entry._replace(agreements=()) for _, entry in sorted(self._entries.items()))
        known = fingerprint(self._config, self._fleet)
        statement = Statement(known, plan.epoch, self._since, entries, farewell=True)
        return [
            Tunnel(self._own, 0, 0, PLAN, pack_plan(plan)),
            *(Tunnel(self._own, 0, 0, AGREEMENTS, pack_statement(part)) for part in in_messages(statement)),
        ]

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
            if plan.origin != self._fleet.fingerprint or not self._near(now, plan):
                continue
            entry = self._entries.get(system, Entry(system))
            if plan.epoch > entry.considered[1]:
                self._entries[system] = entry._replace(considered=(entry.considered[0], plan.epoch))

    def _near(self, now: int, plan: WirePlan) -> bool:
        return abs(plan.epoch - now) <= _MAX_EPOCHS_AWAY * self._config.certified.epoch_us

    def _heartbeat(self, now: int) -> list[Datagram]:
        """Return a heartbeat once a second: routers learn the route from it, and operators see the node."""
        if now < self._next_beat:
            return []
        self._next_beat = now + _SECOND_US
        beat = onboard_heartbeat(self._own)
        return [Datagram("autopilot", self._codecs["autopilot"].encode(beat))]

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
                self._store_plan(now, message)
            case _:
                pass

    def _store_plan(self, now: int, message: Tunnel) -> None:
        """Store a plan of the companion; discard all plans on a farewell, after which the companion lands."""
        try:
            if message.payload_type == AGREEMENTS:
                statement = unpack_statement(message.payload)
                if statement.since > self._since:
                    self._since = statement.since
                    self._entries.clear()
                self._entries.update((entry.peer, entry) for entry in statement.entries)
                if statement.farewell and not self._finishes:
                    self._forget()
            if message.payload_type != PLAN:
                return
            plan = unpack_plan(message.payload)
        except PlanWireError:
            return
        if plan.origin != self._fleet.fingerprint or not rests(plan) or not self._near(now, plan):
            return
        self._plans[plan.epoch] = plan
        # Keep the plan that was flown before the longest pause over which the feed-forward goes on, and those
        # after it.
        begun = [epoch for epoch in self._plans if epoch <= now - MAX_PAUSE_US]
        oldest = max(begun, default=min(self._plans))
        self._plans = {epoch: kept for epoch, kept in self._plans.items() if epoch >= oldest}

    def _horizon(self, now: int) -> Horizon | None:
        """Return the committed plan at ``now`` (µs): the newest that has begun; None without one.

        A column is at the height (m) of the companion's last set-point, if that is not the plan's.
        """
        epoch = max((epoch for epoch in self._plans if epoch <= now), default=None)
        if epoch is None:
            return None
        plan, height = self._plans[epoch], self._height
        if not plan.column or height is None or abs(height - plan.position_m[2]) <= _MAX_DEVIATION_M:
            height = None
        known = self._cached_horizon
        if known is None or known[0] is not plan or known[1] != height:
            horizon = horizon_of(plan)
            if height is not None:
                horizon.knots[:, 2], horizon.knots[:, 5::3] = height, 0.0
            known = self._cached_horizon = plan, height, horizon
        return known[2]

    def _agrees(self, now: int, message: SetpointLocal) -> bool:
        """Return whether the companion's set-point agrees with the stored plan; False without a plan."""
        if self._local is None:
            return False
        self._height = float(self._local.position_to_fleet(message.position)[2])
        horizon = self._horizon(now)
        if horizon is None:
            return False
        planned = self._local.position_to_local(horizon.at(now + self._config.setpoint_lead_us).position)
        off = planned - np.array(message.position)
        # Written so that a NaN does not agree.
        return bool(off @ off <= _MAX_DEVIATION_M**2)

    def _learn(self, now: int, message: SetpointLocal) -> None:
        """Observe what the companion's set-point, if it agrees with the plan, adds to the acceleration."""
        profile = self._profile(now)
        if not self._config.tracking.compensate or self._received is None:
            return
        time = now + self._config.setpoint_lead_us
        horizon = self._horizon(time)
        if horizon is None or profile is None or self._local is None:
            return
        of_plan = self._feedforward.step(time, self._planned, profile.loop, USUAL_DRAG)
        if profile.loop.inverse is not None:
            return
        planned = self._planned(time + profile.loop.lead_us).acceleration + of_plan.acceleration
        added = self._local.velocity_to_fleet(message.acceleration)[:2] - planned[:2]
        # Written so that a NaN is not observed. A plan that has not arrived yet makes a larger difference.
        if added @ added <= self._config.tracking.most**2:
            self._compensation.observe(now, horizon.at(time).velocity[:2], added)

    def _added(self, time: int, planned: Motion, profile: Profile) -> Additions:
        """Return what the set-point at ``time`` (µs) adds to the ``planned`` motion, as the companion's."""
        if not self._config.tracking.compensate:
            return Additions()
        loop = profile.loop
        of_plan = self._feedforward.step(time, self._planned, loop, USUAL_DRAG)
        ahead = self._planned(time + loop.lead_us).acceleration - planned.acceleration
        compensation, most = self._compensation.at(planned.velocity[:2]), self._config.tracking.most
        compensation *= min(1.0, most / max(float(np.linalg.norm(compensation)), most))
        sent = ahead + compensation + of_plan.acceleration
        return of_plan._replace(acceleration=sent)

    def _planned(self, time: int) -> Motion:
        """Return the planned motion at ``time`` (µs); it may be that of the plan to come."""
        horizon = self._horizon(time)
        if horizon is None:
            raise CompanionError("there is no committed plan yet")
        return horizon.at(time)

    def _forget(self) -> None:
        """Discard all plans and the last set-point; nothing is sent until both have been received again."""
        self._plans.clear()
        self._received = None
        self._compensation, self._feedforward = SentCompensation(), PlanFeedforward()

    def _profile(self, now: int) -> Profile | None:
        """Return the autopilot's profile; None unless it is connected, armed and follows set-points."""
        if self._beat is None or now - self._beat[0] > HEARTBEAT_LOST:
            return None
        beat = self._beat[1]
        profile = profile_of(beat)
        armed = beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        steers = profile is not None and armed and is_guided(profile, beat)
        return profile if steers else None
