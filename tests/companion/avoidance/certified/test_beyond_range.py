"""Vehicles that were heard beyond the range: what is known of them, and which of them constrain plans."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.constraint_sources import ConstraintSources
from companion.avoidance.certified.fingerprint import FleetIdentity
from companion.avoidance.certified.fixed_surfaces import FixedSurfaces
from companion.avoidance.certified.negotiation import Geometry
from companion.avoidance.certified.peer_plans import StoredPlan, stored
from companion.config import CompanionConfig
from companion.world import View, World
from mavlink_bridge.messages import GlobalPosition, Source
from mavlink_bridge.wire.agreements import Entry, Statement
from mavlink_bridge.wire.plan import pack
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS
from tests.companion.avoidance.certified.rough import FLEET
from tests.companion.avoidance.certified.two import (
    DISTANCES,
    FRAME,
    LENGTH,
    NOW,
    OTHER,
    OWN,
    doubled,
    epoch,
    leaving,
    plan,
    statement,
)

CONTACT, FAR, LATER = 300_000, 60.0, 50
"""µs; m; epochs, after which a ball of a vehicle ``FAR`` away holds the own place."""


class Here:
    """A vehicle at (``x``, 0, 5) m that counts who is less than 20 m from it; what it knows of the others."""

    def __init__(self, x: float = 0.0) -> None:
        self.x = x
        self.config = CompanionConfig.model_validate(
            {
                "avoidance": "certified",
                "certified": {"range": 50.0, "contact_us": CONTACT, "epoch_us": LENGTH, "dt_us": DT},
            }
        )
        self.world = World(self.config, OWN, 190, FLEET)
        self.agreements = Agreements(
            OWN,
            self.config.certified,
            STEPS,
            FleetIdentity(FRAME, FRAME & 0xFF),
            Geometry(DISTANCES.apart, DISTANCES.agreed),
            self._beyond,
        )
        self.agreements.begin(EPOCH)
        self.agreements.made(plan(x=x))
        self._sources = ConstraintSources(self.config, STEPS, FixedSurfaces(self.config))

    def _beyond(self, _now: int, one: StoredPlan) -> bool:
        return abs(float(one.controls[0, 0, 0]) - self.x) >= 20.0

    def hears_position(self, x: float, now: int = NOW) -> None:
        latitude, longitude, altitude = FLEET.to_geodetic(np.array([x, 0.0, 5.0]))
        source = Source(OTHER, 1)
        message = GlobalPosition(
            source, now - EPOCH, latitude, longitude, altitude, 0.0, (0.0, 0.0, 0.0), None
        )
        self.world.receive(now, "swarm", message)

    def hears_plan(self, x: float, number: int = 0) -> None:
        self.agreements.receive_plan(NOW + number * LENGTH, OTHER, pack(plan(number, x=x)))

    def hears(self, said: Statement, number: int = 0) -> None:
        self.agreements.receive_statement(NOW + number * LENGTH, OTHER, said)

    def constraints(self, number: int) -> Constraints:
        """Of the plan of a vehicle that rests, after epoch ``number``."""
        own = stored(plan(number, x=self.x)).later(epoch(number + 1), STEPS)
        now = NOW + number * LENGTH
        others, field = self._sources.around(
            now,
            epoch(number),
            own,
            own[-1, 2],
            self.agreements,
            self.world,
            View(None, None, None, None),
        )
        return Constraints(len(others.own), bool(field.any()), float(others.distance.max(initial=0.0)))


class Constraints(NamedTuple):
    """Number of other vehicles that constrain a plan, whether the field acts, and the largest distance, m."""

    vehicles: int
    pushed: bool
    largest: float


FREE = Constraints(0, False, 0.0)


@given(st.floats(20.0, 200.0), st.integers(0, 300))
def test_who_was_last_heard_beyond_the_range_is_no_obstacle_however_long_ago(x: float, later: int) -> None:
    one = Here()
    one.hears_plan(x)
    one.hears(statement(0))
    one.hears_position(x)
    assert one.agreements.peers.distant == {OTHER: NOW}
    assert one.constraints(later) == FREE


def test_who_was_counted_and_left_is_no_obstacle() -> None:
    one = Here()
    one.hears_plan(4.0)
    one.hears_position(4.0)
    one.hears_plan(20.0, 1)
    assert one.constraints(LATER) == FREE
    one.hears_plan(19.0, 2)
    assert not one.agreements.peers.distant


def test_who_says_only_where_he_is_may_do_anything_until_a_plan_of_his_comes() -> None:
    one = Here()
    one.hears_position(FAR)
    assert one.constraints(LATER).largest > 0.1 * FAR
    one.hears_plan(FAR)
    assert one.constraints(LATER) == FREE


def test_who_is_heard_without_plans_for_a_contact_may_do_anything() -> None:
    one = Here()
    one.hears_plan(FAR)
    one.hears_position(FAR, NOW + CONTACT)
    assert one.constraints(LATER) == FREE
    one.hears_position(FAR, NOW + 2 * CONTACT)
    assert one.constraints(LATER).vehicles == 1
    one.hears(statement(2), 2)
    assert one.constraints(LATER) == FREE


def test_whom_another_controller_flies_beyond_the_range_may_do_anything() -> None:
    one = Here()
    one.hears_plan(FAR)
    one.hears(statement(0)._replace(away=True))
    one.hears_position(FAR)
    assert one.constraints(LATER).vehicles == 1


def test_who_said_farewell_is_known_to_lie_there_when_this_vehicle_comes_back() -> None:
    """He is silent by then, so that nothing but what was remembered tells where he is."""
    one = Here()
    one.hears_plan(4.0)
    one.hears(leaving())
    assert one.agreements.peers.left.keys() == {OTHER}
    one.x = -FAR
    one.hears_plan(4.0)
    assert one.agreements.peers.left.keys() == {OTHER}
    one.hears_position(4.0)
    # Its last plan, and where it stays.
    away = one.constraints(LATER)
    assert away.vehicles == 2
    assert away.largest < 4.0


def differing() -> Statement:
    return statement(1)._replace(fingerprint=FRAME + 1)


def test_two_vehicles_with_one_id_are_reported_if_one_is_beyond_the_range() -> None:
    one = Here()
    one.hears_plan(FAR)
    one.hears_plan(FAR + 1.0)
    assert doubled(one.agreements) == (OTHER,)


def test_who_is_of_this_fleet_and_comes_is_counted_though_another_has_his_id() -> None:
    one = Here()
    one.hears_plan(FAR)
    one.hears(statement(0))
    one.hears(differing())
    one.hears_plan(4.0, 2)
    assert one.agreements.missing() == {OTHER}


def test_who_is_of_another_fleet_beyond_the_range_is_forgotten() -> None:
    one = Here()
    one.hears_plan(FAR)
    one.hears_position(FAR)
    one.hears(differing())
    assert not one.agreements.peers.distant
    assert one.constraints(LATER).vehicles == 1
    # Nothing more of it is accepted for a while, not even a repeated message.
    one.hears_plan(FAR)
    assert one.agreements.refused == 2


@pytest.mark.parametrize("rejoins", [False, True])
def test_the_farewell_of_who_is_beyond_the_range_is_forgotten_at_an_own_farewell(rejoins: bool) -> None:
    """What he does until the own return may not be received; he is waited for when he is heard anew."""
    one = Here()
    one.hears_plan(4.0)
    one.hears(leaving())
    one.x = -FAR
    one.hears_plan(4.0)
    one.agreements.leave(epoch(1))
    assert not one.agreements.peers.left
    if rejoins:
        assert one.agreements.rejoin()
    else:
        one.agreements.begin(epoch(2))
    one.x = 0.0
    one.hears_plan(4.0)
    assert one.agreements.missing() == {OTHER}
    # The own farewell has answered his plan, and his own is not stated as accepted any more.
    (entry,) = one.agreements.entries(every=True)
    assert entry == Entry(OTHER, (), (epoch(1), EPOCH), departed=False)
