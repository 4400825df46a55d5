"""View of a lock-step flight: sends snapshots of the flight, and applies the viewer's commands."""

from __future__ import annotations

import pickle
import time

import numpy as np

from mavlink_bridge.frames import ned_to_enu
from outrider.scene.changes import Orders
from outrider.scene.datagram_channel import DatagramChannel
from outrider.scene.snapshot import Snapshot, enu_attitude
from outrider.scene.view_commands import decoded
from outrider.simulation.flight import EPOCH, Flight
from outrider.swarm.pace import Pace

PICTURE = 0.04
"""s of wall time between two snapshots."""


class LockStepView:
    """``Onlooker`` of one flight, at one end of ``line``; changes by hand are recorded in ``orders``."""

    def __init__(self, line: DatagramChannel, pace: Pace | None = None) -> None:
        self._line = line
        self._pace = Pace() if pace is None else pace
        self._next = 0.0
        self.orders = Orders()

    def __call__(self, flight: Flight, now: int) -> None:
        """Send a snapshot and apply commands if they are due, then wait to keep the pace."""
        wall = time.monotonic()
        if wall >= self._next:
            self._next = wall + PICTURE
            self._line.send(pickle.dumps(moment(flight, now), pickle.HIGHEST_PROTOCOL))
            self._listen(flight, now)
        self._pace.wait(now, lambda: self._listen(flight, now))

    def _listen(self, flight: Flight, now: int) -> None:
        for data in self._line.receive():
            commands = decoded(data)
            if commands is None:
                continue
            self._pace.receive(commands, now)
            start = flight.conductor.clock_start
            change = self.orders.new(commands, None if start is None else 1e-6 * (now - start))
            if change is not None:
                flight.change(now, change)


def moment(flight: Flight, now: int) -> Snapshot:
    """Return the snapshot of ``flight`` at ``now`` (µs) without changing its state."""
    start, vehicles = flight.conductor.clock_start, flight.snapshots(now)
    seen = [one.companion for one in vehicles]
    _, _, target = flight.truth.latest()
    moving = [one.motion(now).position for one in flight.moving]
    return Snapshot(
        1e-6 * (now - (EPOCH if start is None else start)),
        flight.conductor.stage.value,
        ned_to_enu(np.array([one.position for one in vehicles])).astype(np.float32),
        enu_attitude(np.array([one.attitude for one in vehicles])).astype(np.float32),
        np.array([one.plan for one in seen]),
        np.full(3, np.nan, np.float32) if target is None else target.astype(np.float32),
        np.array(moving, dtype=np.float32).reshape(-1, 3),
        tuple(one.state for one in seen),
        np.array([one.view for one in vehicles]),
        flight.truth.latest_separation,
    )
