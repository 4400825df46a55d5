"""What ends a plan for the backup node, and the farewell of its own."""

from __future__ import annotations

from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.fingerprint import fingerprint
from companion.values.components import COMPONENT
from mavlink_bridge.messages import CommandLong, Source, Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.agreements import pack as pack_statement
from tests.companion.backup_bench import (
    BEGIN,
    COMPANION,
    CONFIG,
    FLEET,
    SYSTEM,
    Bench,
    accepted,
    plan_from,
    silent,
    told,
)


def test_after_an_order_to_land_it_is_silent() -> None:
    """It goes out before the farewell, and before the autopilot says that it has left the mode."""
    bench = Bench()
    bench.run(1.0)
    land = CommandLong(COMPANION, SYSTEM, 1, mavlink.MAV_CMD_NAV_LAND, 0, (0.0,) * 7)
    bench.node.step(bench.now, [bench.tell("autopilot", land)])
    bench.speaks = False
    assert bench.run(3.0) == []


def test_after_a_farewell_it_is_silent() -> None:
    """The companion lands: no set-point may come in between."""
    bench = Bench()
    bench.run(1.0)
    bench.node.step(bench.now, [bench.tell("swarm", stated(farewell=True))])
    bench.speaks = False
    assert bench.run(3.0) == []


def stated(source: Source = COMPANION, *, farewell: bool = False) -> Tunnel:
    """A statement of the companion's agreements."""
    said = Statement(
        fingerprint(CONFIG, FLEET), BEGIN, BEGIN, (Entry(12, ((BEGIN, BEGIN),), (BEGIN, BEGIN)),), farewell
    )
    return Tunnel(source, 0, 0, AGREEMENTS, pack_statement(said))


def test_its_farewell_is_accepted_by_the_others_with_which_there_was_an_agreement() -> None:
    """Also by one that heard nothing before, seconds after the plan was made."""
    bench = Bench()
    bench.run(1.0)
    assert bench.plans[-1].epoch < bench.now
    bench.node.step(bench.now, [bench.tell("swarm", stated())])
    bench.speaks = False
    bench.run(9.0)
    for system, since, expected in ((12, BEGIN, True), (12, BEGIN + 1_000_000, False), (13, BEGIN, False)):
        # The second has begun anew since, and the third has never agreed: this farewell may be an old one.
        assert accepted(bench, system, since) is expected


def test_its_farewell_is_accepted_by_others_whose_plans_it_has_received_since() -> None:
    bench = Bench()
    bench.run(1.0)
    bench.node.step(bench.now, [bench.tell("swarm", stated())])
    bench.speaks = False
    bench.run(9.0)
    now, stray = bench.now, plan_from(bench.now + 1_000_000)
    newest = plan_from(now, seed=2)
    for plan in (newest, newest._replace(epoch=now - 400_000), stray):
        bench.node.hear(now, [told(plan, Source(12, COMPONENT)), told(plan, Source(SYSTEM, COMPONENT))])
    bench.node.hear(now, [told(newest._replace(origin=newest.origin ^ 1), Source(13, COMPONENT))])
    assert accepted(bench, 12, now)
    assert not accepted(bench, 12, now + 200_000)
    assert not accepted(bench, 13, BEGIN)
    bench.node.hear(now, [told(newest, Source(13, COMPONENT))])
    assert accepted(bench, 13, BEGIN)


def test_statements_without_a_farewell_and_those_of_others_change_nothing() -> None:
    bench = Bench()
    bench.run(1.0)
    others = stated(Source(12, COMPONENT), farewell=True)
    garbage = stated()._replace(payload=b"\x01\x01")
    for message in (stated(), others, garbage):
        bench.node.step(bench.now, [bench.tell("swarm", message)])
    bench.speaks = False
    assert bench.run(3.0)


def test_another_companions_plan_is_not_flown() -> None:
    bench = Bench()
    bench.plans = []
    for source in (Source(12, COMPONENT), Source(SYSTEM, 1)):
        bench.node.step(bench.now, [bench.tell("swarm", told(plan_from(BEGIN), source))])
    assert silent(bench).run(3.0) == []
