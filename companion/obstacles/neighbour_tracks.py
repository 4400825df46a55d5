"""Tracks of the positions that others report on the swarm link, and the tracks' last states as rows.

Of the components of a vehicle that report its position one is chosen, because each has a clock and errors of
its own.
"""

from __future__ import annotations

from collections.abc import Set
from functools import lru_cache
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.estimation.estimator import Measured, Six
from companion.estimation.tracks import Track, measured
from companion.obstacles.trusted_peers import TrustedPeers
from companion.values.components import COMPONENT
from companion.values.horizon import Array
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import GlobalPosition

_PRIORITY_US = 1_000_000
"""µs after a component's position during which those of the same vehicle's lower components are ignored.

See ``_rank``.
"""
_LATE_US = 50_000
"""A message dated further (µs) before arrival and least delay is late, or its sender has another clock."""
FLEET_US = 5_000_000
"""A vehicle whose companion has been silent for longer (µs) is no vehicle of the fleet.

So long it stays in a perception formation after its last plan or position.
"""


@lru_cache(maxsize=1024)
def measurement_of(fleet: FleetFrame, message: GlobalPosition, upward: bool) -> Measured | None:
    """Return the measurement in a message, None if invalid; each message is converted once per process."""
    north, east, down = message.velocity_ned
    place = fleet.to_east_north_up(message.latitude, message.longitude, message.altitude)
    return measured(place, (east, north, -down), upward=upward)


def _rank(component: int) -> int:
    """Return the priority of a component as the source of its vehicle's position.

    An outrider companion comes first, and the autopilot last.
    """
    if component == COMPONENT:
        return 2
    return 0 if component == mavlink.MAV_COMP_ID_AUTOPILOT1 else 1


class _Sender:
    """A system whose position is known.

    ``track``, ``row`` of its last state; ``component``: the one whose messages the track uses. ``reported``:
    when (µs) this one last reported a usable position; ``received``: when (µs) a message last changed the
    track's time.
    """

    __slots__ = ("component", "received", "reported", "row", "track")

    def __init__(self, track: Track, row: int, component: int) -> None:
        self.track, self.row, self.component = track, row, component
        self.reported = -_PRIORITY_US
        self.received = 0

    @property
    def by_autopilot(self) -> bool:
        """Whether the track uses the autopilot's messages."""
        return bool(self.component == mavlink.MAV_COMP_ID_AUTOPILOT1)

    def prefers(self, now: int, component: int) -> bool:
        """Return whether messages of another ``component`` are ignored at ``now`` (µs)."""
        return _rank(component) <= _rank(self.component) and now - self.reported < _PRIORITY_US


class LastStates(NamedTuple):
    """Last states of the tracks as rows: system ``ids`` (M), position and velocity ``states`` (M, 6).

    m, m/s, fleet-local ENU. ``times`` (M,) of the states, and ``arrivals`` (M,), which are independent of the
    times at which the measurements are dated; µs.
    """

    ids: tuple[int, ...]
    states: Array
    times: NDArray[np.int64]
    arrivals: NDArray[np.int64]


class NeighbourTracks:
    """Tracks of all systems whose positions were received.

    ``rows``: row of each system in ``last_states``. ``trusted``: trust in the tracks, by rows.
    """

    def __init__(self, config: CompanionConfig, fleet: FleetFrame) -> None:
        self._config = config.neighbour
        self._fleet = fleet
        self._senders: dict[int, _Sender] = {}
        self.rows: dict[int, int] = {}
        # The rows are sampled together at every plan, after those of the tracks that received messages have
        # been updated.
        self._fresh: dict[int, tuple[Six, int, int]] = {}
        none = np.zeros(0, dtype=np.int64)
        self._last = LastStates((), np.zeros((0, 6)), none, none)
        self.trusted = TrustedPeers()
        self._brief = False
        # Only committed plans keep clear of balls, see ``as_arrived``.
        self._watches_lateness = config.avoidance == "certified"
        self._late: dict[int, tuple[int, Measured]] = {}

    @property
    def brief(self) -> bool:
        """Whether the senders' clocks are a simulation's clock, see ``SenderClock``."""
        return self._brief

    @brief.setter
    def brief(self, value: bool) -> None:
        self._brief = value
        for sender in self._senders.values():
            sender.track.brief = value

    def receive(self, now: int, message: GlobalPosition) -> None:
        """Receive the position of another system."""
        system, component = message.source
        sender = self._senders.get(system)
        changes = sender is not None and sender.component != component
        if changes and sender is not None and sender.prefers(now, component):
            # Another component reports the position already, dated by another clock.
            return
        if sender is None or changes:
            track = Track(self._config)
            track.brief = self._brief
        else:
            track = sender.track
        placed = measurement_of(self._fleet, message, self._config.velocity_up)
        before, time_before = track.belief, track.time
        accepted = track.take(now, placed, message.time_boot)
        if self._watches_lateness and placed is not None:
            self._note_lateness(now, system, track.when(now, message.time_boot), placed)
        belief, time = track.belief, track.time
        if belief is None or time is None:
            return
        # Negative if late measurements make the track accept others that it had refused.
        refused = 0 if before is None else belief.refused - before.refused
        if sender is None:
            sender = self._senders[system] = _Sender(track, self._add(now, system), component)
        elif track is not sender.track or refused or belief.doubts:
            self.trusted.restart(now, sender.row)
        sender.track, sender.component = track, component
        if accepted or refused > 0:
            # Unusable positions, such as those of a receiver without a fix, suppress nobody's messages.
            sender.reported = now
        if time != time_before:
            sender.received = now
        self._fresh[sender.row] = belief.x, time, sender.received

    def skip(self, now: int, system: int, component: int) -> None:
        """Note that a message came at ``now`` (µs) that was not decoded: it has priority nevertheless."""
        sender = self._senders.get(system)
        if sender is not None and component == sender.component:
            sender.reported = now

    def _note_lateness(self, now: int, system: int, when: int, placed: Measured) -> None:
        """Note the measurement ``placed`` of ``system`` if it seems late; ``when`` (µs): its date."""
        arrived = now - self._config.delay_us
        if when < arrived - _LATE_US:
            self._late[system] = arrived, placed
        else:
            self._late.pop(system, None)

    def _add(self, now: int, system: int) -> int:
        """Add a row for ``system``, first received at ``now`` (µs); return its index."""
        ids, states, times, arrivals = self._last
        row = self.rows[system] = len(ids)
        states = np.vstack([states, np.zeros(6)])
        self._last = LastStates((*ids, system), states, np.append(times, now), np.append(arrivals, now))
        self.trusted.add(now)
        return row

    def last_states(self) -> LastStates:
        """Return the last states; a later call changes the same arrays."""
        last = self._last
        if self._fresh:
            rows = np.array(list(self._fresh))
            states, last.times[rows], last.arrivals[rows] = zip(*self._fresh.values(), strict=True)
            # Twice as fast as an array of tuples.
            last.states[rows] = np.fromiter(chain.from_iterable(states), np.float64).reshape(-1, 6)
            self._fresh.clear()
        return last

    def by_autopilot(self, system: int) -> bool:
        """Return whether the position of ``system`` is that of its autopilot, not that of a companion."""
        return self._senders[system].by_autopilot

    def when(self, system: int, now: int, stamp: int) -> int | None:
        """Return when (µs) what a companion stamped with ``stamp`` (µs, 0 for none) was true.

        It arrived at ``now`` (µs). Returns None for a stamp from the future, and for a system whose companion
        does not report a fresh position.
        """
        sender = self._senders.get(system)
        if sender is None or sender.by_autopilot:
            return None
        time = sender.track.time
        if time is None or now - time > FLEET_US:
            return None
        return sender.track.dated(now, stamp)

    def last_received(self, without: Set[int]) -> list[tuple[int, int, Array, Array]]:
        """Return ``Neighbours.last_received``."""
        ids, states, times, _ = self.last_states()
        return [
            (system, int(times[row]), states[row, 0:3], states[row, 3:6])
            for row, system in enumerate(ids)
            if system not in without
        ]

    def turn_rates(self) -> dict[int, float]:
        """Return ``Neighbours.turn_rates``."""
        beliefs = ((system, sender.track.belief) for system, sender in self._senders.items())
        return {system: belief.turn[0] for system, belief in beliefs if belief is not None}

    def as_arrived(self) -> list[tuple[int, int, Array, Array]]:
        """Return what ``last_received`` does, dated by arrival, of systems whose last message seems late.

        Either the message is late, and ``last_received`` is right; or the sender's clock began anew, and this
        is right, while the dates that contradict each other spoil the track. Nobody can tell for a while.
        """
        return [
            (system, time, np.array(placed[:3]), np.array(placed[3:]))
            for system, (time, placed) in self._late.items()
            if len(placed) == 6
        ]
