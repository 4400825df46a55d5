"""The backup process flies a silent companion's plan to its end, and only then asks for the hold."""

from __future__ import annotations

from typing import Final

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.committed import carried_on, horizon_of, rest_time, resting
from companion.avoidance.certified.fingerprint import fingerprint
from companion.backup.links import BACKUP
from companion.backup_node import BackupNode
from companion.config import CompanionConfig
from companion.values.components import COMPONENT
from mavlink_bridge.key import Key
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
from mavlink_bridge.wire.agreements import Statement
from mavlink_bridge.wire.agreements import unpack as unpack_statement
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN
from mavlink_bridge.wire.plan import pack
from mavlink_bridge.wire.plan import unpack as unpack_plan
from mavlink_bridge.wire.signing import Signing
from outrider.onboard.backup_copies import Copies, copies_pair, unpack
from outrider.onboard.backup_pilot import DEAF_US, BackupPilot
from outrider.supervision.supervised_node import SETTLING_US
from tests.companion.backup_bench import BEGIN, FLEET, plan_from

SYSTEM: Final = 11
CONFIG: Final = CompanionConfig.model_validate(
    {"task": "goto", "avoidance": "certified", "certified": {"fleet": [SYSTEM, 12]}}
)
AUTOPILOT, COMPANION = Source(SYSTEM, 1), Source(SYSTEM, COMPONENT)
TICK, SECOND = 10_000, 1_000_000
HELD: Final = mavlink.COPTER_MODE_BRAKE


class Rig:
    """A backup pilot, an autopilot that obeys, and a companion that copies until it is told not to."""

    def __init__(self, key: Key | None = None) -> None:
        signing = None if key is None else Signing(key)
        backup = BackupNode(CONFIG, SYSTEM, FLEET, signing, finishes=True)
        self.pilot = BackupPilot(SYSTEM, backup, signing, key)
        self.now, self.plan = BEGIN, plan_from(BEGIN)
        self.copies = self.hears = True
        self.holds = False
        self.mode: int = mavlink.COPTER_MODE_GUIDED
        self.sent: list[tuple[int, Message]] = []
        self._trusted = Codec()
        self._theirs = Signing(key)
        self._vehicle = Codec(None, self._theirs)
        self._readers = {link: Codec(None, None if key is None else Signing(key)) for link in LINKS}

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 1e6 / TICK)):
            for link, data in self.pilot.step(self.now, self._inbox()):
                for message in self._readers[link].feed(data):
                    self.sent.append((self.now, message))
                    order = message if isinstance(message, CommandLong) else None
                    if order is not None and order.command == mavlink.MAV_CMD_DO_SET_MODE:
                        self.mode = round(order.params[1])
            self.now += TICK

    def heard(self, kind: type[Message]) -> list[tuple[int, Message]]:
        return [(at, message) for at, message in self.sent if isinstance(message, kind)]

    def _inbox(self) -> list[Datagram]:
        since, inbox = self.now - BEGIN, []
        self._theirs.present(self.now)
        beat = Heartbeat(AUTOPILOT, 13, 3, 1 | mavlink.MAV_MODE_FLAG_SAFETY_ARMED, self.mode, 4)
        if self.copies:
            vehicle = b""
            if since == 0:
                place = FLEET.latitude, FLEET.longitude, FLEET.altitude
                vehicle += self._trusted.encode(GpsGlobalOrigin(AUTOPILOT, *place, 0))
            if since % SECOND == 0:
                vehicle += self._trusted.encode(beat)
            steers = since % 20_000 == 0 and not self.holds
            autopilot = self._trusted.encode(self._setpoint()) if steers else b""
            swarm = self._trusted.encode(Tunnel(COMPANION, 0, 0, PLAN, pack(self.plan)))
            copies = Copies(self.now, 0, vehicle, autopilot, swarm, holds=self.holds)
            inbox.append(Datagram("copies", copies.pack()))
        elif self.pilot.deaf and self.hears and since % SECOND == 0:
            inbox.append(Datagram("autopilot", self._vehicle.encode(beat)))
        return inbox

    def _setpoint(self) -> SetpointLocal:
        place = horizon_of(self.plan).at(self.now + CONFIG.setpoint_lead_us).position
        ned, zero = (float(place[1]), float(place[0]), -float(place[2])), (0.0, 0.0, 0.0)
        return SetpointLocal(COMPANION, 0, SYSTEM, 1, 1, 0, ned, zero, zero, 0.0, 0.0)


LINKS: Final = ("autopilot", "swarm")
KEY: Final = Key.of_passphrase("correct horse")


def orders(rig: Rig) -> list[int]:
    """Times of the requests for another mode."""
    return [at for at, message in rig.heard(CommandLong)]


def test_it_sends_nothing_beside_the_request_for_the_hold_of_the_companion() -> None:
    rig = Rig()
    rig.run(1.0)
    rig.holds = True
    rig.run(2.0)
    assert rig.heard(SetpointLocal) == orders(rig) == []
    rig.copies, rig.pilot.gone = False, True
    rig.run(8.0)
    assert orders(rig)
    assert rig.mode == HELD


@pytest.mark.parametrize("key", [None, KEY], ids=["unsigned", "signed"])
def test_a_companion_that_ends_has_its_plan_flown_to_the_end_at_rest_before_the_hold(key: Key | None) -> None:
    rig = Rig(key)
    rig.run(1.0)
    assert rig.heard(SetpointLocal) == []
    rig.copies, rig.pilot.gone = False, True
    gone_at = rig.now
    rig.run(8.0)
    rest = rest_time(horizon_of(rig.plan))
    assert gone_at < rest
    # Until the hold has been taken there is a set-point every 20 ms, on the plan.
    points = [(at, m) for at, m in rig.heard(SetpointLocal) if isinstance(m, SetpointLocal)]
    times = [at for at, _ in points]
    assert times[0] <= gone_at + 100_000
    assert max(np.diff(times)) <= 20_000
    for at, message in points:
        place = horizon_of(rig.plan).at(min(at + CONFIG.setpoint_lead_us, rest)).position
        assert np.allclose(message.position, (place[1], place[0], -place[2]), atol=0.02)
    # Nobody asks for the hold before the plan has ended.
    assert min(orders(rig)) >= rest + SETTLING_US
    assert times[-1] >= min(orders(rig))
    assert rig.pilot.over
    assert rig.pilot.held is not None
    assert rig.pilot.held.said == "holds (BRAKE)"
    assert rig.mode == HELD


def test_the_others_are_told_that_the_plan_is_the_last() -> None:
    rig = Rig()
    rig.run(1.0)
    rig.copies, rig.pilot.gone = False, True
    rig.run(1.0)
    told = [message for _, message in rig.heard(Tunnel) if isinstance(message, Tunnel)]
    assert {message.source for message in told} == {Source(SYSTEM, BACKUP)}
    plans = {unpack_plan(message.payload) for message in told if message.payload_type == PLAN}
    statements = {unpack_statement(m.payload) for m in told if m.payload_type == AGREEMENTS}
    # It is told on and on, as the same motion from the present epoch on: old plans are not accepted.
    knots = sorted((plan.epoch - rig.plan.epoch) // rig.plan.dt for plan in plans)
    assert len(knots) > 3
    assert plans == {carried_on(rig.plan, knot) for knot in knots}
    known = fingerprint(CONFIG, FLEET)
    assert statements == {Statement(known, plan.epoch, 0, farewell=True) for plan in plans}


def test_a_plan_that_has_not_begun_is_not_said_to_be_the_last() -> None:
    rig = Rig()
    rig.run(0.5)
    following = plan_from(BEGIN + 700_000)
    rig.pilot.step(rig.now, [copied(rig.now, Tunnel(COMPANION, 0, 0, PLAN, pack(following)))])
    rig.copies, rig.pilot.gone = False, True
    rig.run(0.2)
    assert rig.heard(Tunnel) == []
    rig.run(0.5)
    assert rig.heard(Tunnel)[0][0] >= following.epoch


def test_a_companion_that_ends_before_its_first_plan_begins_has_its_place_held_and_told() -> None:
    """The others may have agreed on that plan: without a farewell those that begin anew wait for ever."""
    rig = Rig()
    rig.plan = resting(BEGIN + 800_000, 200_000, 16, (1.0, 2.0, 5.0), FLEET.fingerprint)
    rig.run(0.3)
    rig.copies, rig.pilot.gone = False, True
    rig.run(0.4)
    held = [message for _, message in rig.heard(SetpointLocal) if isinstance(message, SetpointLocal)]
    assert held
    for message in held:
        np.testing.assert_allclose(message.position, (2.0, 1.0, -5.0), atol=1e-3)
    assert rig.heard(Tunnel) == [], "the plan has not begun"
    rig.run(8.0)
    assert rig.heard(Tunnel)[0][0] >= rig.plan.epoch
    statements = [
        m.payload for _, m in rig.heard(Tunnel) if isinstance(m, Tunnel) and m.payload_type == AGREEMENTS
    ]
    assert all(unpack_statement(payload).farewell for payload in statements)
    assert rig.mode == HELD


def copied(time: int, swarm: Message) -> Datagram:
    codec = Codec()
    return Datagram("copies", Copies(time, swarm=codec.encode(swarm)).pack())


def test_a_companion_that_hangs_keeps_the_vehicle_and_is_not_replaced() -> None:
    """It flies the plan to the end, hovers, and asks for nothing: the companion may return."""
    rig = Rig()
    rig.run(1.0)
    rig.copies = False
    rig.run(4.0)
    assert orders(rig) == []
    assert rig.heard(Tunnel) == []
    before = len(rig.heard(SetpointLocal))
    assert before > 100
    rig.copies = True
    # Its plan has been carried on meanwhile.
    rig.run(0.3)
    count = len(rig.heard(SetpointLocal))
    rig.run(1.0)
    assert len(rig.heard(SetpointLocal)) == count
    assert not rig.pilot.over


def test_one_that_was_stopped_takes_old_copies_for_what_they_are() -> None:
    """Three seconds of them wait: they agreed with the plan when they were sent, and it is flown at once."""
    rig = Rig()
    rig.run(0.5)
    waiting: list[Datagram] = []
    while rig.now < BEGIN + 3_500_000:
        waiting += rig._inbox()
        rig.now += TICK
    rig.copies = False
    rig.pilot.step(rig.now, waiting)
    rig.run(0.2)
    assert len(rig.heard(SetpointLocal)) >= 4


def test_the_autopilots_link_is_read_only_while_nothing_is_copied() -> None:
    rig = Rig()
    rig.run(1.0)
    assert not rig.pilot.deaf
    rig.copies = False
    rig.run(1e-6 * DEAF_US - 0.02)
    assert not rig.pilot.deaf
    rig.run(0.05)
    assert rig.pilot.deaf
    rig.copies = True
    rig.run(0.02)
    assert not rig.pilot.deaf


def test_a_vehicle_that_a_pilot_takes_is_left_alone() -> None:
    rig = Rig()
    rig.run(1.0)
    rig.copies, rig.pilot.gone = False, True
    rig.run(0.5)
    rig.mode = mavlink.COPTER_MODE_LOITER
    rig.run(3.0)
    assert rig.pilot.over
    assert rig.pilot.held is None
    assert orders(rig) == []
    assert rig.mode == mavlink.COPTER_MODE_LOITER


def test_a_vehicle_that_a_pilot_took_since_the_last_heartbeat_is_left_alone() -> None:
    """Its plan is at rest already when the companion ends, but the mode that was heard is of before."""
    rig = Rig()
    rig.run(6.5)
    rig.copies, rig.pilot.gone = False, True
    rig.mode = mavlink.COPTER_MODE_LOITER
    rig.run(3.0)
    assert rig.pilot.over
    assert orders(rig) == []
    assert rig.mode == mavlink.COPTER_MODE_LOITER


def test_without_a_flown_plan_there_is_nothing_to_do() -> None:
    rig = Rig()
    rig.copies, rig.pilot.gone = False, True
    rig.run(0.1)
    assert rig.pilot.over
    assert rig.pilot.held is None
    assert rig.heard(SetpointLocal) == []


def test_forged_heartbeats_do_not_count_with_a_key() -> None:
    """One without a signature says that another controller has the vehicle."""
    rig = Rig(KEY)
    rig.run(1.0)
    rig.copies, rig.pilot.gone = False, True
    rig.run(0.5)
    forged = Codec().encode(Heartbeat(AUTOPILOT, 13, 3, 1, HELD, 4))
    rig.pilot.step(rig.now, [Datagram("autopilot", forged)])
    count = len(rig.heard(SetpointLocal))
    rig.run(0.5)
    assert len(rig.heard(SetpointLocal)) > count + 10


def test_the_stamps_follow_the_companions() -> None:
    """The companion's stamps may be ahead of the clock, by those that it has received."""
    rig = Rig(KEY)
    ahead = Signing(KEY)
    ahead.present(BEGIN + 60 * SECOND)
    rig.pilot.step(rig.now, [Datagram("copies", Copies(BEGIN, ahead.newest).pack())])
    out = rig.pilot.step(rig.now + 2 * SECOND, [])
    reader = Signing(KEY)
    reader.resume(ahead.newest)
    assert [message for _, data in out for message in Codec(None, reader).feed(data)]


def test_copies_arrive_as_they_were_sent_and_the_end_shows() -> None:
    sender, link = copies_pair()
    records = [Copies(5, 7, b"vehicle", b"", b"swarm"), Copies(2**60, 2**48 - 1, b"", b"a" * 3000, b"")]
    for record in records:
        sender.send(record)
    assert [unpack(data) for data in link.receive()] == records
    assert not link.ended
    sender.close()
    assert link.receive() == []
    assert link.ended
    link.close()


def test_a_record_that_nobody_reads_is_lost_and_holds_up_nothing() -> None:
    sender, link = copies_pair()
    for _ in range(5_000):
        sender.send(Copies(autopilot=b"a" * 1000))
    sender.send(Copies(vehicle=b"a" * 70_000))
    assert len(link.receive()) > 100
    link.close()
    sender.send(Copies())
    sender.close()
