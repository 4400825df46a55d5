"""A landing that is stopped: the column goes on where it was reserved, and otherwise all agree again."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from companion.avoidance.certified.commitment import HoldReason
from companion.avoidance.certified.flight import CertifiedFlight
from companion.values.components import COMPONENT
from companion.values.horizon import Array, Motion
from mavlink_bridge.messages import Source, Tunnel
from tests.companion.avoidance.certified.column_flights import CONFIG
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.rough import FLEET
from tests.companion.avoidance.certified.two import OTHER, OWN


class Above:
    """1 hovers, and 2 above it or beside it at ``place`` (3,), m; what they send arrives unless ``lost``."""

    def __init__(self, place: Array) -> None:
        config = CONFIG
        self.places = {OWN: np.array([0.0, 0.0, 5.0]), OTHER: place}
        self.flights = {s: CertifiedFlight(config, Source(s, COMPONENT), FLEET) for s in self.places}
        self.now, self.lost = EPOCH, False
        for system, flight in self.flights.items():
            flight.stand(self.now, self.places[system])

    def step(self, handle: Callable[[CertifiedFlight, int], bool]) -> None:
        """1 is handled by ``handle``, which returns whether it says farewell; 2 hovers."""
        self.now += 20_000
        one, two = self.flights.values()
        sent = one.messages(self.now, farewell=handle(one, self.now))
        hover(two, self.now)
        for receiver, messages in ((two, sent), (one, two.messages(self.now))):
            for message in messages:
                if isinstance(message, Tunnel) and not self.lost:
                    receiver.receive(self.now, message)

    def run(self, handle: Callable[[CertifiedFlight, int], bool], steps: int = 100) -> None:
        for _ in range(steps):
            self.step(handle)

    def missing(self) -> set[int]:
        return set().union(*(flight.agreements.missing() for flight in self.flights.values()))


def hover(flight: CertifiedFlight, now: int) -> bool:
    if flight.due(now):
        flight.commitment.carry_on(HoldReason.MISSING)
    return False


def lowers(flight: CertifiedFlight, now: int) -> bool:
    assert flight.lower(now)
    return False


def sinks(flight: CertifiedFlight, now: int) -> bool:
    flight.descend(now)
    return True


def given_back(flight: CertifiedFlight, now: int) -> bool:
    """It has sunk by a metre."""
    if flight.commitment.column:
        flight.leave_column(now, Motion(np.array([0.0, 0.0, 4.0]), np.zeros(3), np.zeros(3)), flies=True)
        return False
    return hover(flight, now)


@pytest.mark.parametrize("pilot", [False, True], ids=["at once", "after a pilot"])
@pytest.mark.parametrize("heard", [False, True], ids=["farewell lost", "farewell heard"])
def test_after_a_stopped_landing_without_a_reservation_all_agree_again(pilot: bool, heard: bool) -> None:
    """3 m above each other no column can be agreed on, and none may be left without an agreement."""
    pair = Above(np.array([0.3, 0.0, 8.0]))
    one = pair.flights[OWN]
    one.reservation.joined = True
    pair.run(hover)
    assert not pair.missing()
    pair.lost = not heard
    pair.run(sinks, 30)
    if pilot:
        pair.run(lambda flight, now: False, 30)
    pair.lost = False
    one.stand(pair.now, np.array([0.1, 0.0, 4.0]))
    assert not one.commitment.column
    pair.run(given_back)
    assert not pair.missing()


@pytest.mark.parametrize("pilot", [False, True], ids=["at once", "after a pilot"])
def test_after_a_stopped_landing_a_reserved_column_goes_on(pilot: bool) -> None:
    """The others keep it, whether they have heard of the farewell or not; it is left when all agree."""
    pair = Above(np.array([9.0, 0.0, 8.0]))
    one = pair.flights[OWN]
    one.reservation.joined = True
    pair.run(hover)
    pair.run(lowers)
    assert not one.reservation.missing(pair.now)
    pair.run(sinks, 30)
    if pilot:
        pair.run(lambda flight, now: False, 30)
    one.stand(pair.now, np.array([0.1, 0.0, 4.0]))
    assert one.commitment.column
    assert one.commitment.anchored_anew == 0
    pair.run(given_back)
    assert not pair.missing()
    assert not one.commitment.column


def test_a_column_that_waits_for_its_reservation_goes_on_while_its_agreements_last() -> None:
    """The mode changes for a moment: nothing is void, and the others may have agreed on the column."""
    pair = Above(np.array([9.0, 0.0, 8.0]))
    pair.run(hover)
    pair.lost = True
    pair.run(lowers)
    one = pair.flights[OWN]
    assert one.reservation.missing(pair.now)
    one.stand(pair.now, pair.places[OWN])
    assert one.commitment.column
