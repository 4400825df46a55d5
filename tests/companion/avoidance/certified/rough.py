"""How a channel treats messages, and what vehicles of a swarm do when."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mavlink_bridge.frames import FleetFrame

FLEET = FleetFrame(47.397742, 8.545594, 488.0)
NEVER = 1 << 62
CLIMB = 800_000
"""µs."""


def within(since: int, spans: tuple[tuple[int, int], ...]) -> bool:
    return any(begin <= since < end for begin, end in spans)


class Rough(NamedTuple):
    """How a channel treats messages: share lost, longest delay (µs), share sent twice; who is cut off from
    all others from when till when (µs of the run); who hears nothing; from when till when nobody hears whom,
    or only its plans. ``again``: µs after which each message arrives once more, 0 for never."""

    loss: float = 0.0
    delay: int = 0
    twice: float = 0.0
    cuts: tuple[tuple[int, int, frozenset[int]], ...] = ()
    deaf: frozenset[int] = frozenset()
    mute: tuple[tuple[int, int, int], ...] = ()
    alone: tuple[tuple[int, int, int], ...] = ()
    again: int = 0
    reach: float = np.inf
    """Largest distance (m) of the places on plans at which a message that is sent arrives."""


class Habits(NamedTuple):
    """Of one vehicle, µs of the run: when it is switched on, when it steers from, when it leaves; when it is
    not called, and when it may not steer (from, till); how far its clock is ahead. Until it steers it wanders
    about its place by ``wanders`` m; on the ground only its estimate does. When it ``returns`` it joins again
    where it is. When its companion ``restarts`` it has forgotten everything, and begins anew where the
    vehicle is. One that ``takes_off`` stands on the ground below its place before, and climbs for ``CLIMB``;
    one that ``lands`` stays down. A step that begins while it ``stalls`` (from, till) lasts until the end of
    that, and sends nothing if its plan can be recalled."""

    on: int = 0
    steers: int = 0
    leaves: int = NEVER
    frozen: tuple[tuple[int, int], ...] = ()
    released: tuple[tuple[int, int], ...] = ()
    ahead: int = 0
    wanders: float = 0.0
    returns: int = NEVER
    restarts: int = NEVER
    takes_off: int = -1
    lands: int = NEVER
    stalls: tuple[tuple[int, int], ...] = ()
