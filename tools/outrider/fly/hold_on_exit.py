"""Hold request at exit, repeated until the autopilot holds, another controller flies it, or time is up."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from companion.flight.hold_on_exit import HoldOnExit
from mavlink_bridge.clocks.clock import Clock
from mavlink_bridge.links.link import Link
from mavlink_bridge.node import Datagram

_STEP: Final = 10_000
_HURRIED: Final = 300_000
"""Minimum duration of the request even in a hurry (µs)."""


def farewell(word: HoldOnExit, link: Link, clock: Clock, hurry: Callable[[], bool]) -> None:
    """Run ``word`` over ``link``, the autopilot's, on the wall's ``clock`` until it is over.

    If ``hurry()`` returns true, it ends as soon as 0.3 s have passed.
    """
    began = clock.now()
    while not word.over:
        now = clock.now()
        if hurry() and now >= began + _HURRIED:
            return
        inbox = [Datagram("autopilot", data) for data in link.receive()]
        for datagram in word.step(now, inbox):
            link.send(datagram.data)
        if not word.over:
            clock.wait_until(now + _STEP)
