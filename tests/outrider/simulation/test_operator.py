"""The operator: every order is repeated until its companion takes it, and not once more."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from companion.values.components import COMPONENT
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import CommandAck, CommandInt, CommandLong, Message, Source
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from outrider.simulation.operator import LINK, Operator

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
TICK = 10_000


class Bench:
    """An operator whose messages are read and who may be answered."""

    def __init__(self) -> None:
        self.operator = Operator(FLEET)
        self.now = 0
        self.received: list[tuple[int, CommandInt | CommandLong]] = []
        self._codec = Codec()

    def run(self, seconds: float, *answers: Message) -> list[CommandInt | CommandLong]:
        """Time passes, ``answers`` come at its start; what was sent meanwhile."""
        before = len(self.received)
        data = b"".join(Codec().encode(answer) for answer in answers)
        for k in range(round(seconds * 1e6 / TICK)):
            inbox = [Datagram(LINK, data)] if data and k == 0 else []
            for datagram in self.operator.step(self.now, inbox):
                assert datagram.link == LINK
                for message in self._codec.feed(datagram.data):
                    assert isinstance(message, CommandInt | CommandLong)
                    self.received.append((self.now, message))
            self.now += TICK
        return [message for _, message in self.received[before:]]


def ack(system: int, command: int, result: int = 0) -> CommandAck:
    return CommandAck(Source(system, COMPONENT), command, result, 0, 0, 255, 190)


def test_an_order_is_repeated_each_half_second_until_it_is_acknowledged() -> None:
    bench = Bench()
    bench.operator.take_off(11, 5.0)
    assert len(bench.run(2.2)) == 5
    assert np.diff([time for time, _ in bench.received]).tolist() == [500_000] * 4
    assert bench.operator.unanswered == [11]
    assert bench.run(3.0, ack(11, mavlink.MAV_CMD_NAV_TAKEOFF)) == []
    assert bench.operator.unanswered == []


def test_a_goal_is_refused_until_it_is_accepted_or_another_one_is_ordered() -> None:
    """Not by another result than a denial, nor by a late denial."""
    bench, command = Bench(), mavlink.MAV_CMD_DO_REPOSITION
    denied = ack(11, command, mavlink.MAV_RESULT_DENIED)
    bench.operator.goal(11, np.zeros(3))
    bench.run(0.1, ack(11, command, mavlink.MAV_RESULT_TEMPORARILY_REJECTED))
    bench.run(0.1, ack(11, mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_RESULT_DENIED))
    assert bench.operator.refused_goals == []
    assert len(bench.run(1.0, denied)) == 2
    assert bench.operator.refused_goals == [11]
    bench.operator.goal(11, np.ones(3))
    assert bench.operator.refused_goals == []
    bench.run(0.1, denied)
    assert bench.operator.refused_goals == [11]
    bench.run(0.1, ack(11, command))
    bench.run(0.1, denied)
    assert bench.operator.refused_goals == []


def test_it_says_what_was_ordered() -> None:
    bench = Bench()
    bench.operator.take_off(11, 4.5)
    bench.operator.land(12)
    bench.operator.goal(13, np.array([3.0, -7.0, 6.0]))
    takeoff, land, goal = bench.run(0.1)
    assert isinstance(takeoff, CommandLong)
    assert isinstance(land, CommandLong)
    assert isinstance(goal, CommandInt)
    assert (takeoff.command, takeoff.target_system, takeoff.params[6]) == (
        mavlink.MAV_CMD_NAV_TAKEOFF,
        11,
        4.5,
    )
    assert (land.command, land.target_system) == (mavlink.MAV_CMD_NAV_LAND, 12)
    assert (goal.command, goal.target_system, goal.frame) == (mavlink.MAV_CMD_DO_REPOSITION, 13, 0)
    assert {m.target_component for m in (takeoff, land, goal)} == {COMPONENT}
    place = FLEET.to_enu(goal.x * 1e-7, goal.y * 1e-7, goal.z)
    # degE7 on the wire: 1.1 cm.
    assert np.allclose(place, (3.0, -7.0, 6.0), atol=0.01)


@pytest.mark.parametrize(
    "other",
    [
        ack(12, mavlink.MAV_CMD_NAV_TAKEOFF),
        ack(11, mavlink.MAV_CMD_NAV_LAND),
        *(ack(11, mavlink.MAV_CMD_NAV_TAKEOFF, result) for result in range(1, 10)),
    ],
)
def test_nothing_else_counts_as_its_answer(other: CommandAck) -> None:
    bench = Bench()
    bench.operator.take_off(11, 5.0)
    bench.run(1.0)
    assert len(bench.run(1.0, other)) == 2
    assert bench.operator.unanswered == [11]


def test_a_new_order_replaces_an_old_one_of_its_kind() -> None:
    bench = Bench()
    bench.operator.goal(11, np.array([1.0, 0.0, 5.0]))
    bench.run(0.1)
    bench.operator.goal(11, np.array([2.0, 0.0, 5.0]))
    first, *rest = bench.run(1.0)
    assert isinstance(first, CommandInt)
    assert all(isinstance(message, CommandInt) and message.x == first.x for message in rest)
    assert FLEET.to_enu(first.x * 1e-7, first.y * 1e-7, first.z)[0] == pytest.approx(2.0, abs=0.01)


def test_an_order_that_follows_an_answer_is_sent_again() -> None:
    bench = Bench()
    bench.operator.land(11)
    bench.run(0.1)
    bench.run(0.1, ack(11, mavlink.MAV_CMD_NAV_LAND))
    bench.operator.land(11)
    assert len(bench.run(0.1)) == 1


@settings(deadline=None, max_examples=50)
@given(
    st.lists(
        st.tuples(
            st.integers(11, 14),
            st.sampled_from(
                [mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_DO_REPOSITION]
            ),
        ),
        unique=True,
        min_size=1,
    ),
    st.data(),
)
def test_exactly_what_is_not_answered_goes_on(orders: list[tuple[int, int]], data: st.DataObject) -> None:
    bench = Bench()
    for system, command in orders:
        if command == mavlink.MAV_CMD_NAV_TAKEOFF:
            bench.operator.take_off(system, 5.0)
        elif command == mavlink.MAV_CMD_NAV_LAND:
            bench.operator.land(system)
        else:
            bench.operator.goal(system, np.array([0.0, 0.0, 5.0]))
    # An order to land takes back one to take off that came before it and is still open.
    taken_back = {
        (system, mavlink.MAV_CMD_NAV_TAKEOFF)
        for i, (system, command) in enumerate(orders)
        if command == mavlink.MAV_CMD_NAV_LAND and (system, mavlink.MAV_CMD_NAV_TAKEOFF) in orders[:i]
    }
    orders = [order for order in orders if order not in taken_back]
    assert {(m.target_system, m.command) for m in bench.run(0.5)} == set(orders)
    answered = set(data.draw(st.lists(st.sampled_from(orders), unique=True)))
    again = bench.run(0.5, *(ack(*order) for order in sorted(answered)))
    assert {(m.target_system, m.command) for m in again} == set(orders) - answered
    assert bench.operator.unanswered == sorted({system for system, _ in set(orders) - answered})


@settings(deadline=None, max_examples=50)
@given(st.binary(max_size=300))
def test_any_bytes_leave_it_working(noise: bytes) -> None:
    operator = Operator(FLEET)
    operator.take_off(11, 5.0)
    assert len(operator.step(0, [Datagram(LINK, noise)])) == 1
    assert len(operator.step(500_000, [])) == 1
