"""A vehicle without GPS says so at once, long before its autopilot gives up, and the others keep further
away."""

from __future__ import annotations

import numpy as np
import pytest

from companion.config import CompanionConfig
from companion.obstacles.neighbours import Neighbours
from mavlink_bridge.messages import GlobalPosition, Source, StatusText, Tunnel
from mavlink_bridge.wire.uncertainty import PAYLOAD_TYPE, unpack
from tests.scenarios.single_vehicle import SITE, SYSTEM, SingleVehicle


def told(vehicle):
    """When (s after the first of them) it said how far it may be off, and what."""
    found = [
        (time, unpack(m.payload))
        for time, link, m in vehicle.sent
        if link == "swarm" and isinstance(m, Tunnel) and m.payload_type == PAYLOAD_TYPE
    ]
    return np.array([1e-6 * (time - found[0][0]) for time, _ in found]), np.array([r for _, r in found])


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_the_loss_is_said_within_a_second_and_the_doubt_grows_until_gps_is_back(flavour):
    vehicle = SingleVehicle(flavour).fly().run(2.0)
    assert vehicle.companion.world.doubt == 0.0
    assert not any(isinstance(m, Tunnel) and m.payload_type == PAYLOAD_TYPE for _, _, m in vehicle.sent)
    vehicle.autopilot.lose_gps()
    vehicle.run(1.0)
    assert vehicle.texts[-1] == "GPS is lost: dead reckoning"
    assert "positioning" in vehicle.companion.health.concerns
    assert vehicle.companion.health.blinkered
    vehicle.run(3.0)
    # The autopilot says nothing of it yet.
    assert not [m for m in vehicle.all(StatusText) if "Failsafe" in m.text]
    doubt = vehicle.companion.world.doubt
    assert 0.4 < doubt < 0.9
    assert doubt > np.linalg.norm(vehicle.place - vehicle.companion.world.at(vehicle.now).own.position)
    vehicle.autopilot.regain_gps()
    vehicle.run(4.0)
    assert vehicle.companion.world.doubt == 0.0
    assert "positioning" not in vehicle.companion.health.concerns
    assert not vehicle.companion.health.blinkered
    vehicle.run(5.0)
    times, radii = told(vehicle)
    grows = times < 3.0
    assert (np.diff(radii[grows]) >= 0.0).all()
    # With every position while it lasts, and for three seconds that it is over.
    assert np.diff(times).max() < 0.11
    assert radii[-1] == 0.0
    assert 2.8 < times[radii == 0.0].max() - times[radii == 0.0].min() < 3.1


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_gps_that_is_refused_is_said_as_well(flavour):
    """A jump beyond the gate: the estimator coasts, and jumps after seven seconds."""
    vehicle = SingleVehicle(flavour).fly().run(2.0)
    vehicle.autopilot.shift_gps((6.0, 0.0, 0.0))
    vehicle.run(1.5)
    assert vehicle.texts[-1] == "Estimator refuses GPS: dead reckoning"
    vehicle.run(4.0)
    assert vehicle.companion.world.doubt > 0.7


def test_those_who_hear_it_keep_as_much_further_away_on_both_sides():
    vehicle = SingleVehicle("px4").fly().run(2.0)
    vehicle.autopilot.lose_gps()
    near, before = Neighbours(CompanionConfig(), 12, SITE), None
    received = len(vehicle.sent)
    vehicle.run(4.0)
    for time, link, message in vehicle.sent[received:]:
        if link != "swarm":
            continue
        if isinstance(message, GlobalPosition):
            near.receive_position(time, message)
        elif isinstance(message, Tunnel):
            near.receive_plan(time, message)
        if before is None and near.ages(time):
            before = near.obstacles(time)
    after = near.obstacles(vehicle.now, vehicle.place[None] + 8.0)
    assert after.ids == (SYSTEM,)
    radius = told(vehicle)[1][-1]
    assert radius > 0.5
    assert after.d_min - before.d_min == pytest.approx(radius)
    assert after.d_safe - before.d_safe == pytest.approx(radius)
    assert after.radius - before.radius == pytest.approx(radius)
    # For three seconds of silence about it.
    assert near.obstacles(vehicle.now + 3_200_000).d_min == pytest.approx(before.d_min)
    # Its own distances grow as well: it is as far from where it believes that they are.
    world = vehicle.companion.world
    world.doubt = 0.0
    view = world.at(vehicle.now)
    world.neighbours.receive_position(vehicle.now, position(12, [3.0, 0.0, 5.0], vehicle.now))
    ahead = np.broadcast_to(view.own.position, (world.config.horizon.steps + 1, 3))
    usual = world.obstacles(vehicle.now, view, ahead)
    world.doubt = 0.5
    wide = world.obstacles(vehicle.now, view, ahead)
    assert wide.ids == usual.ids
    assert len(wide.ids) == 1
    assert wide.d_min - usual.d_min == pytest.approx(0.5)
    assert wide.d_safe - usual.d_safe == pytest.approx(0.5)


def position(system, place, now):
    latitude, longitude, altitude = SITE.to_geodetic(np.array(place))
    return GlobalPosition(
        Source(system, 195), now % 10**9, latitude, longitude, altitude, 0.0, (0.0, 0.0, 0.0), None
    )
