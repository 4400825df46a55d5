"""Who said farewell: it is a post where its last plan ends, as long as that is where it is heard."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified.committed import resting
from companion.avoidance.certified.fingerprint import fingerprint
from companion.avoidance.certified.flight import CertifiedFlight
from companion.avoidance.certified.margins import beside, between
from companion.avoidance.field.planner import standing
from companion.config import CompanionConfig
from companion.config.certified import CertifiedConfig
from companion.telemetry.sharing import position_message
from companion.values.components import COMPONENT
from companion.values.horizon import Array
from companion.values.phase import Phase
from companion.world import View, World
from mavlink_bridge.messages import Source, Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.agreements import pack as pack_statement
from mavlink_bridge.wire.agreements import unpack as unpack_statement
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN
from mavlink_bridge.wire.plan import pack, unpack
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS
from tests.companion.avoidance.certified.rough import FLEET
from tests.companion.bench import FLEET as BENCH
from tests.companion.bench import Bench, only

LEFT, OWN, STRANGER = 1, 2, 77
CONFIG = CompanionConfig(
    task="goto",
    avoidance="certified",
    turning_sense="right",
    certified=CertifiedConfig(dt_us=DT, epoch_us=DT, fleet=(LEFT, OWN)),
)
LEAST = between(CONFIG.certified, CONFIG.field, CONFIG.limits)
SAME = beside(CONFIG.certified, CONFIG.field, CONFIG.limits)
END = np.array([0.0, 0.6, 5.0])
"""Where the last plan of the one that left rests, beside the way."""
_NOTHING = View(None, None, None, None)


def nowhere(since: int) -> None:
    """Not heard."""


def at(place: Array) -> Callable[[int], Array]:
    return lambda since: place


def leave(flight: CertifiedFlight, end: Array) -> None:
    """The other says farewell with a plan at rest at ``end`` (3,), m, and has received the own first plan."""
    agreements = flight.agreements
    agreements.receive_plan(EPOCH, LEFT, pack(resting(EPOCH, DT, STEPS, end, FLEET.fingerprint)))
    entry = Entry(OWN, considered=(EPOCH, agreements.since))
    farewell = Statement(fingerprint(CONFIG, FLEET), EPOCH, EPOCH, (entry,), farewell=True)
    agreements.receive_statement(EPOCH, LEFT, farewell)
    assert agreements.peers.left.keys() == {LEFT}


def way(received: Callable[[int], Array | None], *, whom: int = LEFT, end: Array = END) -> Array:
    """Where the other flies (k, 3), every 20 ms, from 6 m before to 6 m behind the origin: one said farewell
    at ``end``, and ``whom`` is heard at ``heard`` by µs since, from 0.1 s before its last plan begins on."""
    flight, world = CertifiedFlight(CONFIG, Source(OWN, 195), FLEET), World(CONFIG, OWN, 0, FLEET)
    flight.stand(EPOCH, np.array([-6.0, 0.0, 5.0]))
    leave(flight, end)
    places = []
    for since in range(-100_000, 6_000_000, 20_000):
        now, place = EPOCH + since, received(since)
        if place is not None:
            boot = since + 1_000_000
            world.receive(
                now, "swarm", position_message(Source(whom, 195), boot, FLEET, place, np.zeros(3), None)
            )
        if since < 0:
            continue
        if flight.due(now):
            assert flight.plan(now, standing(np.array([6.0, 0.0, 5.0])), world, _NOTHING)
        horizon = flight.horizon()
        assert horizon is not None
        places.append(horizon.at(now).position)
    return np.array(places)


def nearest(flown: Array, place: Array) -> float:
    """m, heights aside."""
    return float(np.linalg.norm((flown - place)[:, :2], axis=1).min())


@pytest.mark.parametrize("down", [0.0, 5.0], ids=["flying", "landed"])
def test_heard_where_its_plan_ends_it_is_the_post_that_it_was(down: float) -> None:
    """At any height, and as far beside it as its estimate may be off."""
    silent = way(nowhere)
    assert nearest(silent, END) >= LEAST - 1e-3
    np.testing.assert_array_equal(way(at(END + np.array([0.9 * SAME, 0.0, -down]))), silent)


def test_where_landing_drifts_to_nobody_flies_either() -> None:
    drifted = END - (0.0, 0.9 * LEAST, 3.0)
    flown = way(at(drifted))
    assert nearest(flown, drifted) >= LEAST - 1e-3
    assert nearest(flown, END) >= LEAST - 1e-3
    assert flown[-1, 0] > 5.0


@pytest.mark.parametrize("place", [(4.0, 0.0, 5.0), (2.0, -0.5, 6.0)])
def test_taken_over_and_flown_elsewhere_it_is_a_stranger_like_all(place: tuple[float, ...]) -> None:
    there, aside = np.array(place), END + np.array([0.0, 12.0, 0.0])
    flown = way(at(there), end=aside)
    np.testing.assert_array_equal(flown, way(at(there), end=aside, whom=STRANGER))
    assert np.linalg.norm(flown - there, axis=1).min() >= LEAST


def test_where_it_was_before_its_last_plan_says_nothing() -> None:
    """It was heard on its way there, and not since."""
    before = END - (6.0, 3.0, 0.0)
    np.testing.assert_array_equal(way(lambda since: before if since < 0 else None), way(nowhere))


@pytest.mark.parametrize("off", [0.0, 1.1, 3.0])
def test_who_was_carried_aside_after_landing_and_switched_off_keeps_nobody_away_from_elsewhere(
    off: float,
) -> None:
    """A minute later: what stands on the ground is no danger that grows."""
    end, goal = np.array([0.0, 12.0, 5.0]), np.array([6.0, 0.0, 5.0])
    place = end + np.array([0.0, off * LEAST, -5.0])
    flight, world = CertifiedFlight(CONFIG, Source(OWN, 195), FLEET), World(CONFIG, OWN, 0, FLEET)
    flight.stand(EPOCH, np.array([-6.0, 0.0, 5.0]))
    leave(flight, end)
    for since in range(0, 1_000_000, 20_000):
        said = position_message(Source(LEFT, 195), 1_000_000 + since, FLEET, place, np.zeros(3), None)
        world.receive(EPOCH + since, "swarm", said)
    begin = EPOCH + 60_000_000
    for now in range(begin, begin + 8_000_000, 20_000):
        if flight.due(now):
            assert flight.plan(now, standing(goal), world, _NOTHING)
    horizon = flight.horizon()
    assert horizon is not None
    assert np.linalg.norm(horizon.at(begin + 8_000_000).position - goal) < 0.1


def test_who_lands_without_a_reservation_says_farewell_with_a_column() -> None:
    """The other hovers above it and is silent for ever, so there is no room for a column before."""
    config = {"avoidance": "certified", "guard": {"settle_us": 1_000_000}}
    bench = Bench(**config).take_off()
    bench.fly(1.0)
    above = resting(bench.now - bench.now % 200_000, DT, STEPS, (0.3, 0.0, 9.0), BENCH.fingerprint)
    said = Statement(fingerprint(bench.config, BENCH), above.epoch, above.epoch)
    other = Source(12, COMPONENT)
    bench.fly(
        1.0,
        bench.datagram("swarm", Tunnel(other, 0, 0, PLAN, pack(above))),
        bench.datagram("swarm", Tunnel(other, 0, 0, AGREEMENTS, pack_statement(said))),
    )
    bench.order(mavlink.MAV_CMD_NAV_LAND)
    sent = bench.fly(8.0)
    assert bench.phase is Phase.DONE
    told = only(Tunnel, sent, "swarm")
    columns = {one.epoch: one.column for one in (unpack(m.payload) for m in told if m.payload_type == PLAN)}
    statements = [unpack_statement(one.payload) for one in told if one.payload_type == AGREEMENTS]
    farewells = [one.epoch for one in statements if one.farewell]
    assert farewells
    assert all(columns[epoch] for epoch in farewells)
    assert not columns[min(columns)]
