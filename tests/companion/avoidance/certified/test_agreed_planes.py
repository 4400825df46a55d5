"""Planes of an agreement, which are computed once, are those of its two plans at every later epoch."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance.certified.agreed_planes import made, stacked
from companion.avoidance.certified.columns import Distances, levelled
from companion.avoidance.certified.committed import carried_on, committed, controls, resting
from companion.avoidance.certified.deadlock import mean_velocities
from companion.avoidance.certified.negotiation import Geometry, Negotiation
from companion.avoidance.certified.pair import Agreement
from companion.avoidance.certified.peer import Peer
from companion.avoidance.certified.peer_plans import PlanFile, StoredPlan, stored
from companion.avoidance.certified.separating_planes import Others, agreed_planes, planes
from companion.errors import CompanionError
from companion.values.horizon import Array
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS, random_plan

LENGTH = DT
"""Length of an epoch, µs."""
NOTHING = Others(*np.zeros((2, 0, STEPS, 3, 3)), np.zeros((0, STEPS)))
FURTHER = 0.25
"""Distance (m) that each column adds."""


def pair(seed: int, columns: tuple[bool, bool], later: int) -> tuple[StoredPlan, StoredPlan]:
    """Two plans, of which the second begins ``later`` epochs after the first."""
    rng = np.random.default_rng(seed)
    own, other = random_plan(rng, np.zeros(3)), random_plan(rng, np.array([3.0, 0.5, 0.2]))
    other = other._replace(epoch=own.epoch + later * LENGTH)
    return stored(own._replace(column=columns[0])), stored(other._replace(column=columns[1]))


@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.booleans(), st.booleans()),
    st.integers(-3, 3),
    st.integers(0, 2 * STEPS),
    st.booleans(),
    st.sampled_from([1.0, 2.0]),
)
def test_they_are_those_of_the_two_plans(
    seed: int, columns: tuple[bool, bool], later: int, epochs: int, planar: bool, downwash: float
) -> None:
    """Bit by bit, also after both plans have ended; so are the velocities of the other plan."""
    own, other = pair(seed, columns, later)
    distances = Distances(1.5, FURTHER, planar=planar, downwash=downwash)
    begins = max(own.plan.epoch, other.plan.epoch) + epochs * LENGTH
    committed = controls(random_plan(np.random.default_rng(seed + 1), np.zeros(3)))
    one, two = own.later(begins, STEPS), other.later(begins, STEPS)
    if any(columns):
        two = levelled(two, one)
    least = distances.least(sum(columns))
    rows = agreed_planes(one, two, least, upright=planar, downwash=downwash)
    unshared = Others(one[None], two[None], np.full((1, STEPS), least), np.full(1, 1.0 / downwash))
    agreed = NOTHING._replace(agreed=stacked([made(own, other, distances.agreed)], begins, DT, STEPS))
    expected = planes(committed, NOTHING._replace(agreed=rows[None]), 0.02, upright=planar)
    found = planes(committed, agreed, 0.02, upright=planar)
    for part, wanted in zip(found, expected, strict=True):
        np.testing.assert_array_equal(part, wanted)
    np.testing.assert_array_equal(found.normals, planes(committed, unshared, 0.02, upright=planar).normals)
    velocities = (mean_velocities(others, 1.0, 2) for others in (agreed, unshared))
    np.testing.assert_array_equal(*velocities)


@pytest.mark.parametrize("off", [-LENGTH, LENGTH // 2])
def test_there_are_none_before_the_agreement_or_between_knots(off: int) -> None:
    own, other = pair(1, (False, False), 2)
    one = made(own, other, Distances(1.5, FURTHER).agreed)
    with pytest.raises(CompanionError, match="no planes for"):
        stacked([one], other.plan.epoch + off, DT, STEPS)


def test_they_come_before_those_of_pairs_that_share_nothing() -> None:
    own, other = pair(1, (False, False), 0)
    distances = Distances(1.5, FURTHER)
    planes_of = made(own, other, distances.agreed)
    ball = np.broadcast_to(np.array([9.0, 0.0, 0.0]), (STEPS, 3, 3))
    begins = own.plan.epoch
    committed = own.later(begins, STEPS)
    both = Others(
        committed[None],
        ball[None],
        np.full((1, STEPS), 1.0),
        agreed=stacked([planes_of, planes_of], begins, DT, STEPS),
    )
    found = planes(committed, both, 0.0)
    assert found.normals.shape == (3, STEPS, 3)
    np.testing.assert_array_equal(found.normals[0], found.normals[1])
    assert found.normals[2, 0] @ (1.0, 0.0, 0.0) == pytest.approx(-1.0, abs=1e-2)


def in_a_row(epochs: int) -> tuple[PlanFile, Peer]:
    """The own plans and the peer: both fly east and are agreed on these plans, and carried them on since."""
    pushes = np.zeros((STEPS, 3))
    pushes[:5, 0], pushes[5:10, 0] = 2.0, -2.0
    files = PlanFile(), PlanFile()
    for file, x in zip(files, (0.0, 5.0), strict=True):
        plan = committed(resting(EPOCH, DT, STEPS, (x, 0.0, 5.0), 7), pushes)
        for one in (plan, carried_on(plan, epochs)):
            file.add(stored(one))
    peer = Peer(1, 2)
    peer.plans, peer.pair.kept = files[1], (Agreement(EPOCH, EPOCH),)
    return files[0], peer


@pytest.mark.parametrize(
    ("shift", "epochs", "current"), [(0.75, 1, True), (0.75, 12, False), (0.0, 12, True)]
)
def test_an_agreement_of_the_flight_is_not_as_good_as_one_at_rest(
    shift: float, epochs: int, current: bool
) -> None:
    """Of two that flew in a row and rest as planned the one ahead would have an eighth of the room."""
    distances = Distances(1.5, FURTHER, planar=True, shift=shift)
    own, peer = in_a_row(epochs)
    negotiation = Negotiation(own, STEPS, Geometry(distances.apart, distances.agreed))
    assert negotiation.current(peer, EPOCH + epochs * DT) is current


def test_planes_that_are_held_are_not_computed_anew() -> None:
    """Of an agreement and the one that may replace it, only the latter's are."""
    distances = Distances(1.5, FURTHER, planar=True, shift=0.75)
    begun: list[Array] = []

    def agreed(own: Array, other: Array, columns: int) -> Array:
        begun.append(own[0, 0])
        return distances.agreed(own, other, columns)

    own, peer = in_a_row(1)
    negotiation = Negotiation(own, STEPS, Geometry(distances.apart, agreed))
    first, second = own.get(EPOCH), own.get(EPOCH + DT)
    other = peer.plans.get(EPOCH)
    assert first is not None
    assert second is not None
    assert other is not None
    peer.agreed[Agreement(EPOCH, EPOCH)] = made(first, other, distances.agreed)
    assert negotiation.current(peer, EPOCH + DT)
    np.testing.assert_array_equal(begun, [second.controls[0, 0]])
    # Planes of other plans with the same epochs, as of before a vehicle began anew, are not used.
    begun.clear()
    peer.agreed[Agreement(EPOCH, EPOCH)] = made(second, other, distances.agreed)
    assert negotiation.current(peer, EPOCH + DT)
    np.testing.assert_array_equal(begun, [first.controls[0, 0], second.controls[0, 0]])
