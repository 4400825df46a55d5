"""A real-time flight for the view: told by the process that leads it, from what the others show."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from outrider.scene.changes import Change, Orders
from outrider.scene.datagram_channel import Line
from outrider.scene.snapshot import Array, Moment, Single, State, enu_attitude
from outrider.scene.view_commands import decoded

PICTURE = 50_000
"""µs between two moments that are told."""


class Seen(NamedTuple):
    """``since`` s after the goal event, or after the start before it; stage; positions (K, 3), the target's
    place and those of the moving obstacles, fleet-local ENU."""

    since: float
    stage: str
    positions: Array
    target: Array | None
    moving: Sequence[Array]


class Shown(Protocol):
    """What companions and vehicles show of themselves: ``attitudes`` (K, 4) FRD in NED, ``plans``
    (K, KNOTS, 6), K ``states``."""

    @property
    def attitudes(self) -> Array:
        """NaN until a vehicle shows itself."""
        ...

    @property
    def plans(self) -> NDArray[np.float32]:
        """NaN where there is none."""
        ...

    @property
    def states(self) -> tuple[State, ...]:
        """In the order of the vehicles."""
        ...


class RealTimeView:
    """At one end of ``line``; what is changed by hand goes into ``orders``."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self._next = 0
        self.orders = Orders()

    def show(self, now: int, seen: Seen, shown: Shown) -> None:
        """Tell the moment ``now`` (µs), unless it is too soon after the one before."""
        if now < self._next:
            return
        self._next = now + PICTURE
        target: Single = np.full(3, np.nan, np.float32)
        moment = Moment(
            seen.since,
            seen.stage,
            seen.positions.astype(np.float32),
            enu_attitude(shown.attitudes).astype(np.float32),
            shown.plans,
            target if seen.target is None else seen.target.astype(np.float32),
            np.array(seen.moving, dtype=np.float32).reshape(-1, 3),
            shown.states,
        )
        self._line.send(pickle.dumps(moment, pickle.HIGHEST_PROTOCOL))

    def changes(self, seconds: float | None) -> Iterator[Change]:
        """What is newly wished, ``seconds`` after the goal event."""
        for data in self._line.receive():
            wishes = decoded(data)
            change = None if wishes is None else self.orders.new(wishes, seconds)
            if change is not None:
                yield change
