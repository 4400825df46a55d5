"""Typed orders of a flight alone reach the node; all other words are answered with what is allowed."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest

from outrider.errors import OutriderError
from outrider.interruption import ReceivedSignal
from outrider.onboard.line_input import LineInput
from outrider.preflight.course import Box
from outrider.preflight.node import Preflight
from outrider.preflight.terms import FlightTerms, Terms
from outrider.preflight.typed_orders import TypedOrders
from tests.outrider.preflight.bench import ORIGIN, companion


class Desk:
    """A node on the ground, and a pipe to type into."""

    def __init__(self) -> None:
        fly = FlightTerms(100, 5.0, Box())
        self.node = Preflight(Terms(1, companion(), ORIGIN, 5.0, 5.0, 7, fly=fly))
        self.said: list[str] = []
        self.stops: list[ReceivedSignal] = []
        self.reader, self.writer = os.pipe()
        self.orders = TypedOrders(self.node, LineInput(self.reader), self.stops, self.said.append)

    def type(self, line: str) -> list[str]:
        os.write(self.writer, f"{line}\n".encode())
        before = len(self.said)
        self.orders.look(0)
        return self.said[before:]


@pytest.fixture
def desk() -> Iterator[Desk]:
    found = Desk()
    yield found
    os.close(found.reader)
    os.close(found.writer)


def test_a_go_counts_only_when_it_is_asked_for(desk: Desk) -> None:
    turns = desk.node.turns
    assert turns is not None
    (answer,) = desk.type("go")
    assert answer.startswith("go: not now: waiting for")
    assert not turns.go
    turns.asks = True
    # Said once, and then the go is taken.
    assert len(desk.type(" GO ")) == 1
    assert turns.go


def test_other_words_are_answered(desk: Desk) -> None:
    assert desk.type("") == []
    assert desk.type("lnd") == ["'lnd' is no order here; allowed: go, land, quit; did you mean land?"]
    assert desk.type("hold") == ["'hold' is no order here; allowed: go, land, quit"]


def test_quit_and_a_signal_end_it(desk: Desk) -> None:
    with pytest.raises(OutriderError, match="no fleet file"):
        desk.type("quit")
    desk.stops.append(ReceivedSignal(signal.SIGTERM, 0.0))
    with pytest.raises(OutriderError, match="SIGTERM"):
        desk.orders.look(0)
