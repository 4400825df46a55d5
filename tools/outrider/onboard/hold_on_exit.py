"""Hold request at exit, repeated for 3 s or until the autopilot holds, disarms or has another controller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from companion.flight.hold_on_exit import HoldOnExit
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.links.link import Link
from mavlink_bridge.node import Datagram

_STEP_US: Final = 10_000
_MIN_DURATION_US: Final = 300_000
"""Minimum duration (µs) of a request that is not over, even if ``hurry()`` is true."""


def farewell(word: HoldOnExit, link: Link, clock: Clock, hurry: Callable[[], bool]) -> None:
    """Run ``word`` over the autopilot's ``link`` on the wall ``clock`` until it is over.

    If ``hurry()`` is true, return as soon as 0.3 s have passed.
    """
    began = clock.now()
    while not word.over:
        now = clock.now()
        if hurry() and now >= began + _MIN_DURATION_US:
            return
        inbox = [Datagram("autopilot", data) for data in link.receive()]
        for datagram in word.step(now, inbox):
            link.send(datagram.data)
        if not word.over:
            clock.wait_until(now + _STEP_US)
