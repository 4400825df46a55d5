"""Columns of air: nobody climbs or sinks by its autopilot before all others keep clear of its place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from companion.avoidance.certified.column_agreements import ColumnAgreements
from companion.avoidance.certified.columns import Distances
from companion.avoidance.certified.negotiation import Negotiation
from companion.avoidance.certified.separating_planes import agreed_planes
from companion.values.horizon import Array
from tests.companion.avoidance.certified.column_flights import UNTIL, at_random, below, fly, places, wandering
from tests.companion.avoidance.certified.draws import delays, losses
from tests.companion.avoidance.certified.rough import CLIMB, NEVER, Habits, Rough
from tests.companion.avoidance.certified.swarm import Swarm
from tests.companion.avoidance.certified.two import LENGTH
from tests.companion.avoidance.certified.vehicle import Vehicle

FLIGHTS = settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow])


@FLIGHTS
@given(st.integers(0, 2**16), losses, delays)
@example(597, 0.0, 500_000)  # lands in the step after it has left the column of its take-off
@example(34275, 0.0, 500_000)  # carries a column on in a step that lasts, and then proposes it
def test_a_column_is_kept_whatever_happens(seed: int, loss: float, delay: int) -> None:
    """From the climb's beginning to its end, and from the landing's on, all plans are apart horizontally."""
    assert not at_random(seed, Rough(loss, delay, 0.2)).faults()


@pytest.mark.parametrize("rough", [Rough(), Rough(0.2, 100_000), Rough(0.6, 100_000)], ids=["0", "20", "60"])
def test_all_take_off_fly_and_land(rough: Rough) -> None:
    """Beside each other at once, also where messages are lost, and each back at its place."""
    row, above = places(3, 1), wandering(3, 1)
    # They are back after five seconds: one that landed on its way could cover the place of another.
    swarm = Swarm(row, rough, [Habits(takes_off=0, lands=10_000_000)] * 3, 1)
    swarm.run(16_000_000, lambda since, system: above(since, system) if since < 5e6 else row[system - 1])
    assert not swarm.faults()
    for vehicle in swarm.vehicles:
        assert len(vehicle.columns) == 2
        assert any(made.found for made in vehicle.made)


def test_columns_matter_in_these_flights() -> None:
    """Others come as near to a column as they may."""
    least = [at_random(seed, Rough()).least() for seed in range(8)]
    d = at_random(0, Rough()).d
    assert min(least) < d + 0.1


def test_who_hears_nothing_of_an_expected_vehicle_does_not_climb() -> None:
    silent = Rough(cuts=((0, NEVER, frozenset({3})),))
    swarm = fly([Habits(takes_off=0), Habits(), Habits()], silent, 1)
    vehicle = swarm.vehicles[0]
    assert not vehicle.columns
    assert vehicle.flight.reservation.missing(0) == "the agreement of 3 on its column"
    assert not swarm.faults()


def test_a_silent_vehicle_that_cannot_meet_the_column_does_not_keep_it_from_becoming_a_plan_in_space() -> (
    None
):
    """It begins anew while the other climbs, is heard once more, and then never again."""
    begins = 900_000
    habits = [Habits(takes_off=0), Habits(), Habits(restarts=begins, frozen=((begins + 100_000, NEVER),))]
    swarm = fly(habits, Rough(), 1, 4_000_000)
    ((climbs, left),) = swarm.vehicles[0].columns
    assert climbs < begins < climbs + CLIMB
    assert swarm.vehicles[0].flight.agreements.missing() == {3}
    assert left < climbs + CLIMB + 3 * LENGTH
    assert not swarm.faults()


@FLIGHTS
@given(st.integers(0, 2**16), losses, delays)
def test_plans_are_apart_if_another_begins_anew_during_the_climb(seed: int, loss: float, delay: int) -> None:
    """It rests when its companion restarts; afterwards both wander, and it may be silent for ever."""
    rng = np.random.default_rng(seed)
    begins = int(rng.integers(300_000, 2_000_000))
    silent = ((begins + int(rng.integers(20_000, 400_000)), NEVER),) if rng.random() < 0.5 else ()
    row, wander = places(2, seed), wandering(2, seed)
    swarm = Swarm(
        row, Rough(loss, delay, 0.2), [Habits(takes_off=0), Habits(restarts=begins, frozen=silent)], seed
    )
    swarm.run(UNTIL, lambda since, system: row[system - 1] if since < begins else wander(since, system))
    assert not swarm.faults()


def test_who_does_not_take_off_is_passed_and_is_not_waited_for() -> None:
    swarm = fly([Habits(takes_off=NEVER), Habits(), Habits()], Rough(0.2, 100_000), 3)
    assert not swarm.faults()
    assert {made.system for made in swarm.made() if made.found} == {2, 3}


def flights() -> Iterator[Swarm]:
    """Of one below another, and twenty at random."""
    yield below(3_000_000)
    for seed in range(20):
        yield at_random(seed, Rough(0.9, 500_000) if seed % 2 else Rough(0.3, 150_000, 0.2))


def climb_without_waiting(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Vehicle, "may_move", lambda self, now: self.flight.commitment.column)


def ignore_the_column(patch: pytest.MonkeyPatch) -> None:
    """Planes near a column are in space."""

    def in_space(self: Distances, own: Array, other: Array, columns: int) -> Array:
        upright, downwash = self._planar, self._downwash
        return agreed_planes(own, other, self.least(columns), upright=upright, downwash=downwash)

    patch.setattr(Distances, "agreed", in_space)


def agree_nearer_than_allowed(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(ColumnAgreements, "near", lambda self, plans=None, column=None: set())
    patch.setattr(Negotiation, "_reservable", lambda self, newest, plans: True)


def keep_planes_in_space(patch: pytest.MonkeyPatch) -> None:
    """The landing begins though an agreement on a plan in space is kept."""
    patch.setattr(ColumnAgreements, "_on_column", lambda self, one: True)


def look_at_heights(patch: pytest.MonkeyPatch) -> None:
    """A plan is taken for apart from a column if it is high enough above it."""
    apart = Distances.apart
    patch.setattr(Distances, "apart", lambda self, one, other, columns: apart(self, one, other, 0))


@pytest.mark.parametrize(
    "mutation",
    [
        climb_without_waiting,
        ignore_the_column,
        agree_nearer_than_allowed,
        keep_planes_in_space,
        look_at_heights,
    ],
)
def test_a_missing_rule_is_found(mutation: Callable[[Any], None], monkeypatch: pytest.MonkeyPatch) -> None:
    mutation(monkeypatch)
    assert any(swarm.faults() for swarm in flights())
