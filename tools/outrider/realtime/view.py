"""View of a real-time flight, sent by the parent process."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from outrider.scene.changes import Change, Orders
from outrider.scene.datagram_channel import DatagramChannel
from outrider.scene.snapshot import Array, Single, Snapshot, State, enu_attitude
from outrider.scene.view_commands import decoded

PICTURE = 50_000
"""µs between two snapshots."""


class Seen(NamedTuple):
    """State of a flight as the parent process observes it.

    ``since``: time (s) since the goal event; before that, since the first observation. Positions of the
    vehicles (K, 3), the ``target`` (3,) or None, and the ``moving`` obstacles (3,) are fleet-local ENU (m).
    """

    since: float
    stage: str
    positions: Array
    target: Array | None
    moving: Sequence[Array]


class ViewedNode(Protocol):
    """State that companions and vehicles provide for a view.

    ``attitudes`` (K, 4): quaternions w x y z, FRD in NED; ``plans`` (K, KNOTS, 6); K ``states``.
    """

    @property
    def attitudes(self) -> Array:
        """Attitudes; NaN until a vehicle has written its own."""
        ...

    @property
    def plans(self) -> NDArray[np.float32]:
        """Plans; NaN where there is none."""
        ...

    @property
    def views(self) -> NDArray[np.float32]:
        """Rows (K, 12) of cameras; NaN where there is none."""
        ...

    @property
    def states(self) -> tuple[State, ...]:
        """States in the order of the vehicles."""
        ...


class RealTimeView:
    """Connection by ``line`` to the view's process; ``orders`` records the changes that its user makes."""

    def __init__(self, line: DatagramChannel) -> None:
        self._line = line
        self._next = 0
        self.orders = Orders()

    def show(self, now: int, seen: Seen, shown: ViewedNode) -> None:
        """Send the snapshot at ``now`` (µs), unless the previous one is too recent."""
        if now < self._next:
            return
        self._next = now + PICTURE
        target: Single = np.full(3, np.nan, np.float32)
        moment = Snapshot(
            seen.since,
            seen.stage,
            seen.positions.astype(np.float32),
            enu_attitude(shown.attitudes).astype(np.float32),
            shown.plans,
            target if seen.target is None else seen.target.astype(np.float32),
            np.array(seen.moving, dtype=np.float32).reshape(-1, 3),
            shown.states,
            shown.views,
        )
        self._line.send(pickle.dumps(moment, pickle.HIGHEST_PROTOCOL))

    def changes(self, seconds: float | None) -> Iterator[Change]:
        """Yield the new changes; ``seconds``: time since the goal event (s), None before it."""
        for data in self._line.receive():
            commands = decoded(data)
            change = None if commands is None else self.orders.new(commands, seconds)
            if change is not None:
                yield change
