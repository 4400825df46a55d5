"""The orders of an operator, and what ends or begins control in flight, for both autopilots."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.values.phase import Phase
from tests.companion.bench import FLAVOURS, FLEET, ORIGIN_REQUEST
from tests.companion.flight.rig import GROUND, HEALTHY, HEIGHT, IN_FLIGHT, OWN, Rig, ack, beat


class Order(NamedTuple):
    """An operator's order in a phase: whether it is taken, and the phase afterwards."""

    phase: Phase
    order: str
    height: float
    taken: bool
    after: Phase


ORDERS = [
    Order(Phase.CONNECT, "go", 6.0, True, Phase.CONNECT),
    Order(Phase.CONNECT, "go", 0.49, False, Phase.CONNECT),
    Order(Phase.CONNECT, "go", 121.0, False, Phase.CONNECT),
    Order(Phase.CONNECT, "go", math.nan, False, Phase.CONNECT),
    Order(Phase.CONNECT, "go", math.inf, False, Phase.CONNECT),
    Order(Phase.CONNECT, "land", 0.0, False, Phase.CONNECT),
    Order(Phase.PREPARE, "go", 6.0, True, Phase.PREPARE),
    Order(Phase.PREPARE, "land", 0.0, True, Phase.LAND),
    Order(Phase.ESCORT, "go", 6.0, True, Phase.ESCORT),
    Order(Phase.ESCORT, "land", 0.0, True, Phase.SETTLE),
    Order(Phase.SETTLE, "land", 0.0, True, Phase.SETTLE),
    Order(Phase.SETTLE, "go", 6.0, False, Phase.SETTLE),
    Order(Phase.LAND, "land", 0.0, True, Phase.LAND),
    Order(Phase.LAND, "go", 6.0, False, Phase.LAND),
    Order(Phase.DONE, "go", 6.0, False, Phase.DONE),
    Order(Phase.DONE, "land", 0.0, True, Phase.DONE),
]


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("case", ORDERS, ids=lambda c: f"{c.phase.value} {c.order} {c.height:g}")
def test_orders(flavour, case):
    rig = Rig(flavour)
    rig.pilot.phase = case.phase
    taken = rig.pilot.go(case.height) if case.order == "go" else rig.pilot.land()
    assert (taken, rig.pilot.phase) == (case.taken, case.after)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_without_a_heartbeat_for_three_seconds_nothing_is_steered(flavour):
    rig = Rig(flavour).escorting()
    rig.run(2.9)
    assert rig.pilot.streaming
    rig.run(0.2)
    assert not rig.pilot.streaming
    rig.tick(beat(flavour, armed=True, guided=True))
    assert rig.pilot.streaming


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_hold_come_back_and_go_on(flavour):
    rig = Rig(flavour).escorting()
    flying = beat(flavour, armed=True, guided=True)
    pilot = rig.pilot
    for order, phase in (
        (pilot.hold, Phase.HOLD),
        (pilot.come_back, Phase.RETURN),
        (lambda: pilot.go(HEIGHT), Phase.ESCORT),
        (pilot.come_back, Phase.RETURN),
        (pilot.hold, Phase.HOLD),
    ):
        assert order()
        assert pilot.phase is phase
        assert rig.run(1.0, flying) == []
        assert pilot.streaming
    pilot.returned()
    assert pilot.phase is Phase.HOLD
    assert pilot.come_back()
    pilot.returned()
    assert pilot.phase is Phase.SETTLE
    assert not pilot.hold()
    np.testing.assert_array_equal(pilot.start, [0.0, 0.0, GROUND])


@pytest.mark.parametrize(("system", "component"), [(255, 190), (OWN.system, 1)])
def test_an_answer_to_somebody_else_settles_nothing(system, component):
    rig = Rig("ardupilot")
    rig.prepared()
    rig.run(0.1, beat("ardupilot"), HEALTHY)
    rig.tick(ack(mavlink.MAV_CMD_DO_SET_MODE)._replace(target_system=system, target_component=component))
    assert mavlink.MAV_CMD_DO_SET_MODE in {command for command, _ in rig.run(2.0, beat("ardupilot"), HEALTHY)}
    # MAVLink 1 does not say whom it answers.
    rig.tick(ack(mavlink.MAV_CMD_DO_SET_MODE)._replace(target_system=0, target_component=0))
    assert mavlink.MAV_CMD_DO_SET_MODE not in {
        command for command, _ in rig.run(2.0, beat("ardupilot"), HEALTHY)
    }


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("acks", [False, True])
def test_the_origin_is_asked_for_in_flight_every_ten_seconds_and_soon_after_it_changes(flavour, acks):
    """The message about a new one may be lost, and one that came may have been an old copy."""
    rig = Rig(flavour).escorting()
    rig.run(1.0, beat(flavour, armed=True, guided=True), IN_FLIGHT, acks=acks)
    rig.sent.clear()
    rig.run(60.0, beat(flavour, armed=True, guided=True), IN_FLIGHT, acks=acks)
    asked = [at for at, command, params in rig.sent if (command, params[0]) == ORIGIN_REQUEST]
    assert len(asked) == 6
    assert {b - a for a, b in pairwise(asked)} == {10_000_000}
    rig.view = rig.view._replace(local=FLEET.local(FLEET.latitude + 1e-5, FLEET.longitude, FLEET.altitude))
    rig.sent.clear()
    changed = rig.now
    rig.run(3.0, beat(flavour, armed=True, guided=True), IN_FLIGHT, acks=acks)
    (asked,) = (at for at, command, params in rig.sent if (command, params[0]) == ORIGIN_REQUEST)
    # Within two seconds the answer would be taken for an old copy.
    assert 2_000_000 < asked - changed < 2_300_000


def test_nothing_is_asked_of_a_vehicle_that_another_controller_flies():
    rig = Rig("px4").escorting()
    rig.run(1.0, beat("px4", armed=True, guided=True), IN_FLIGHT)
    rig.run(0.1, beat("px4", armed=True, mode=3 << 16), IN_FLIGHT)
    assert rig.pilot.phase is Phase.YIELDED
    sent = rig.run(30.0, beat("px4", armed=True, mode=3 << 16), IN_FLIGHT)
    assert ORIGIN_REQUEST not in {(command, params[0]) for command, params in sent}
