"""View of a lock-step flight: sends snapshots of the flight, and applies the viewer's commands."""

from __future__ import annotations

import pickle
import time

import numpy as np

from mavlink_bridge.frames import ned_to_enu
from outrider.scene.changes import Change, Orders
from outrider.scene.companion_snapshot import companion_snapshot
from outrider.scene.datagram_channel import DatagramChannel
from outrider.scene.snapshot import Snapshot, enu_attitude
from outrider.scene.view_commands import LOSSY, ViewCommands, decoded
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
                obey(flight, now, change)


def moment(flight: Flight, now: int) -> Snapshot:
    """Return the snapshot of ``flight`` at ``now`` (µs) without changing its state."""
    start, autopilots = flight.conductor.clock_start, flight.autopilots
    seen = [companion_snapshot(companion, now) for companion in flight.companions]
    _, _, target = flight.truth.latest()
    moving = [one.motion(now).position for one in flight.moving]
    return Snapshot(
        1e-6 * (now - (EPOCH if start is None else start)),
        flight.conductor.stage.value,
        ned_to_enu(np.array([a.state.position for a in autopilots])).astype(np.float32),
        enu_attitude(np.array([a.state.attitude for a in autopilots])).astype(np.float32),
        np.array([one.plan for one in seen]),
        np.full(3, np.nan, np.float32) if target is None else target.astype(np.float32),
        np.array(moving, dtype=np.float32).reshape(-1, 3),
        tuple(one.state for one in seen),
    )


def obey(flight: Flight, now: int, change: Change) -> None:
    """Apply ``change`` at ``now`` (µs)."""
    if change.methods is not None:
        for companion in flight.companions[: flight.scenario.vehicles]:
            companion.use(ViewCommands(methods=change.methods).method_names)
    if change.loss is not None:
        flight.network.lose(LOSSY, change.loss)
    if change.target is not None:
        flight.target.move(now, np.array(change.target))
