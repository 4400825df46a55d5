"""A backup node beside a companion that speaks until it is told not to."""

from __future__ import annotations

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.committed import committed, horizon_of
from companion.avoidance.certified.fingerprint import identity
from companion.avoidance.certified.negotiation import Geometry
from companion.avoidance.certified.separating_planes import AGREED
from companion.backup_node import BackupNode
from companion.config import CompanionConfig
from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.values.components import COMPONENT
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.key import Key
from mavlink_bridge.messages import GpsGlobalOrigin, Heartbeat, Message, SetpointLocal, Source, Tunnel
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.agreements import unpack as unpack_statement
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, WirePlan, pack, quantise
from mavlink_bridge.wire.signing import Signing

SYSTEM = 11
FLEET = FleetFrame(47.397742, 8.545594, 488.0)
CONFIG = CompanionConfig.model_validate(
    {"task": "goto", "avoidance": "certified", "certified": {"dt_us": 200_000, "epoch_us": 200_000}}
)
DT, STEPS, TICK = 200_000, 16, 10_000
BEGIN = 1_767_225_600_000_000
AUTOPILOT, COMPANION = Source(SYSTEM, 1), Source(SYSTEM, COMPONENT)
YAW = 0.7


class Bench:
    """A backup node, and a companion that speaks until it is told not to."""

    def __init__(
        self, key: Key | None = None, companions: Key | None = None, config: CompanionConfig = CONFIG
    ) -> None:
        """``key``: the backup node's; ``companions``: its companion's, and the autopilot's."""
        self.node = BackupNode(config, SYSTEM, FLEET, None if key is None else Signing(key))
        signing = Signing(companions)
        signing.present(BEGIN)
        self.codec, self.reader = Codec(None, signing), Codec()
        self.now = BEGIN
        self.speaks = self.beats = True
        self.autopilot, self.mode, self.armed = ARDUPILOT.autopilot, mavlink.COPTER_MODE_GUIDED, True
        self.origin = np.zeros(3)
        """Of the vehicle's local frame, as the backup node hears it; the companion's is the fleet's."""
        self.ahead = 0
        """µs by which the companion's clock is ahead of the backup node's."""
        self.plans = [plan_from(BEGIN)]
        self.height: float | None = None
        """Height (m) of the companion's set-points; None: that of the plan."""
        self.east = 0.0
        """Distance (m) of the companion's set-points east of the plan."""
        self.sent: list[tuple[int, SetpointLocal]] = []

    def run(self, seconds: float) -> list[tuple[int, SetpointLocal]]:
        """Go on for so long; what the backup node sent meanwhile."""
        before = len(self.sent)
        for _ in range(round(seconds * 1e6 / TICK)):
            for link, data in self.node.step(self.now, self._inbox()):
                assert link == "autopilot"
                for message in self.reader.feed(data):
                    if isinstance(message, SetpointLocal):
                        self.sent.append((self.now, message))
                    else:
                        assert isinstance(message, Heartbeat)
            self.now += TICK
        return self.sent[before:]

    def tell(self, link: str, message: Message) -> Datagram:
        return Datagram(link, self.codec.encode(message))

    def _inbox(self) -> list[Datagram]:
        since, inbox = self.now - BEGIN, []
        if since == 0:
            latitude, longitude, altitude = FLEET.to_geodetic(self.origin)
            origin = GpsGlobalOrigin(AUTOPILOT, latitude, longitude, altitude, 0)
            inbox.append(self.tell("autopilot", origin))
        if self.beats and since % 1_000_000 == 0:
            custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            base = custom | mavlink.MAV_MODE_FLAG_SAFETY_ARMED * self.armed
            inbox.append(self.tell("autopilot", Heartbeat(AUTOPILOT, 13, self.autopilot, base, self.mode, 4)))
        if self.speaks and since % 20_000 == 0:
            inbox.append(self.tell("autopilot", self._spoken()))
        if self.speaks and since % 50_000 == 0:
            inbox += [self.tell("swarm", told(plan)) for plan in self.plans]
        return inbox

    def _spoken(self) -> SetpointLocal:
        """What the companion sends: its plan, by its own clock."""
        now = self.now + self.ahead
        begun = [plan for plan in self.plans if plan.epoch <= now]
        # Before its first plan begins it holds the place where that begins; without a plan it flies another.
        first = self.plans[0] if self.plans else plan_from(BEGIN)
        plan = max(begun, default=first, key=lambda one: one.epoch)
        place = horizon_of(plan).at(now + CONFIG.setpoint_lead_us).position
        place[0] += self.east
        if self.height is not None:
            place[2] = self.height
        ned, zero = (float(place[1]), float(place[0]), -float(place[2])), (0.0, 0.0, 0.0)
        return SetpointLocal(COMPANION, self.now - BEGIN, SYSTEM, 1, 1, 0, ned, zero, zero, YAW, 0.0)


def plan_from(epoch: int, seed: int = 1) -> WirePlan:
    random = np.random.default_rng(seed)
    start = quantise(epoch, DT, [1.0, 2.0, 5.0], [1.5, -0.5, 0.1], np.zeros((STEPS, 3)), FLEET.fingerprint)
    return committed(start, random.uniform(-1.0, 1.0, (STEPS, 3)))


def told(plan: WirePlan, source: Source = COMPANION) -> Tunnel:
    return Tunnel(source, 0, 0, PAYLOAD_TYPE, pack(plan))


def silent(bench: Bench) -> Bench:
    """After a second of talk the companion is silent."""
    assert bench.run(1.0) == []
    bench.speaks = False
    return bench


def accepted(bench: Bench, system: int, since: int) -> bool:
    """Whether ``system``, which begins at ``since`` (µs), accepts the backup node's farewell now."""
    certified, known = CONFIG.certified, identity(CONFIG, FLEET)
    agreements = Agreements(
        system,
        certified,
        STEPS,
        known,
        Geometry(lambda *_: True, lambda *_: np.zeros((STEPS + 1, AGREED))),
    )
    agreements.begin(since)
    agreements.made(plan_from(since, seed=2))
    for message in bench.node.farewell(bench.now):
        assert isinstance(message, Tunnel)
        if message.payload_type == PAYLOAD_TYPE:
            agreements.receive_plan(bench.now, SYSTEM, message.payload)
        else:
            agreements.receive_statement(bench.now, SYSTEM, unpack_statement(message.payload))
    if SYSTEM not in agreements.peers.left:
        return False
    end = horizon_of(bench.plans[-1]).at(bench.now).position
    assert np.allclose(agreements.peers.left[SYSTEM].controls[-1, 2], end, atol=1e-9)
    return True
