"""Who needs an agreement: all that are expected, heard or named."""

from __future__ import annotations

import pytest

from mavlink_bridge.wire.agreements import Entry
from mavlink_bridge.wire.plan import pack
from tests.companion.avoidance.certified.plans import EPOCH
from tests.companion.avoidance.certified.two import (
    LENGTH,
    NOW,
    OTHER,
    OWN,
    THIRD,
    agreements,
    plan,
    statement,
)


def test_who_is_expected_is_missing_until_there_is_an_agreement() -> None:
    one = agreements(OWN, OWN, OTHER)
    assert one.missing() == {OTHER}
    one.made(plan())
    one.receive_plan(NOW, OTHER, pack(plan(x=4.0)))
    one.update(NOW)
    assert one.missing() == {OTHER}
    one.receive_statement(NOW, OTHER, statement(0, Entry(OWN, ((EPOCH, EPOCH),), (EPOCH, EPOCH))))
    one.update(NOW)
    assert not one.missing()


@pytest.mark.parametrize("by", ["plan", "statement", "name"])
def test_who_is_heard_or_named_is_a_member_and_never_forgotten(by: str) -> None:
    """It is named to others as soon as a statement shows that it is of this fleet."""
    one = agreements()
    if by == "plan":
        one.receive_plan(NOW, THIRD, pack(plan()))
    elif by == "statement":
        one.receive_statement(NOW, THIRD, statement(0))
    else:
        one.receive_statement(NOW, OTHER, statement(0, Entry(THIRD)))
    for number in range(20):
        assert THIRD in one.peers.members
        assert THIRD in one.missing()
        assert (THIRD in {entry.peer for entry in one.entries(every=True)}) == (by != "plan")
        one.receive_statement(NOW + number * LENGTH, OTHER, statement(number, Entry(OWN)))


def test_who_left_by_the_word_of_another_is_no_member_unless_it_was_heard() -> None:
    one = agreements()
    one.receive_statement(NOW, OTHER, statement(0, Entry(THIRD, departed=True)))
    assert one.peers.members == {OTHER}
    one.receive_statement(NOW, OTHER, statement(1, Entry(THIRD)))
    assert one.peers.members == {OTHER, THIRD}
    # What was stated before and comes late changes nothing.
    one.receive_statement(NOW, OTHER, statement(0, Entry(THIRD, departed=True)))
    assert one.peers.members == {OTHER, THIRD}
    one.receive_plan(NOW, THIRD, pack(plan()))
    one.receive_statement(NOW, OTHER, statement(2, Entry(THIRD, departed=True)))
    assert one.peers.members == {OTHER, THIRD}


def test_nobody_is_a_peer_of_itself() -> None:
    one = agreements(OWN, OWN, OTHER)
    one.receive_statement(NOW, OWN, statement(0, Entry(THIRD)))
    one.receive_statement(NOW, OTHER, statement(0, Entry(OWN)))
    assert one.peers.members == {OTHER}
