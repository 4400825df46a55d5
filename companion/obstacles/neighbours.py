"""Other vehicles, and moving obstacles, received on the swarm link: tracks and shared horizons.

A neighbour that shares no horizon, or whose horizon is stale or no longer agrees with its position, is taken
at its n = 0 position for the whole horizon (Sec. IV-A), or extrapolated at constant velocity if so
configured.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from functools import lru_cache
from itertools import chain, compress
from math import hypot, inf

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.config.formation import Perception
from companion.estimation.estimator import Measured, Six
from companion.estimation.tracks import State, Track, measured
from companion.obstacles.alignment import align, extrapolate, within
from companion.obstacles.reachable_ball import Ball, flown_on
from companion.obstacles.relevance_filter import Ages, RelevanceFilter
from companion.obstacles.shared_plans import SharedPlans
from companion.obstacles.trusted_peers import TrustedPeers, follows
from companion.obstacles.uncertainty import ReportedUncertainty
from companion.obstacles.unheard import Heard, Unheard
from companion.values.components import COMPONENT
from companion.values.horizon import Array
from companion.values.mates import Mates
from companion.values.obstacles import Obstacles
from companion.values.speed_bounds import SpeedBounds
from companion.values.vectors import limit
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import GlobalPosition, Tunnel
from mavlink_bridge.wire.plan import PAYLOAD_TYPE
from mavlink_bridge.wire.uncertainty import PAYLOAD_TYPE as DOUBT

_SYSTEM_IDS = 255
"""Number of system ids."""
_PRIORITY_US = 1_000_000
"""µs after a component's position during which those of the same vehicle's lower components are ignored.

See ``_rank``.
"""
_LATE_US = 50_000
"""A message dated further (µs) before arrival and least delay is late, or its sender has another clock."""
_FLEET_US = 5_000_000
"""A vehicle whose companion has been silent for longer (µs) is no vehicle of the fleet.

So long it stays in a perception formation after its last plan or position.
"""
_MAX_PLAN_DEVIATION = 1.0
"""m; if a neighbour is further than this from its plan, its track is used instead of the plan.

With ``guard.astray_us`` the limit is ``guard.tube``.
"""


@lru_cache(maxsize=1024)
def measurement_of(fleet: FleetFrame, message: GlobalPosition, upward: bool) -> Measured | None:
    """Return the measurement in a message, None if invalid; each message is converted once per process."""
    north, east, down = message.velocity_ned
    place = fleet.to_east_north_up(message.latitude, message.longitude, message.altitude)
    return measured(place, (east, north, -down), upward=upward)


def fading(config: CompanionConfig) -> Array | None:
    """Return the share (N + 1, 1) of a vehicle's present deviation from its plan that is left at n = 0…N.

    Returns None if ``guard.astray_us`` is off.
    """
    if not config.guard.astray_us:
        return None
    ahead = config.horizon.dt_us * np.arange(config.horizon.steps + 1.0)
    return np.asarray(np.exp(-ahead / config.guard.astray_us))[:, None]


def _rank(component: int) -> int:
    """Return the priority of a component as the source of its vehicle's position.

    An outrider companion comes first, and the autopilot last.
    """
    if component == COMPONENT:
        return 2
    return 0 if component == mavlink.MAV_COMP_ID_AUTOPILOT1 else 1


class _Sender:
    """A system whose position is known.

    ``track``, ``row`` of its last state; ``component``: the one whose messages the track uses, because each
    has a clock and errors of its own. ``reported``: when (µs) this one last reported a usable position;
    ``received``: when (µs) a message last changed the track's time.
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


class Neighbours:
    """Everything received on the swarm link, by system id."""

    def __init__(self, config: CompanionConfig, system: int, fleet: FleetFrame) -> None:
        self._config = config
        self._system = system
        self._fleet = fleet
        self._velocity_up = config.neighbour.velocity_up
        self._senders: dict[int, _Sender] = {}
        # The tracks' last states as rows, in the order of the tracks. They are sampled together at every
        # plan, after the rows of the tracks that received messages have been updated.
        self._ids: tuple[int, ...] = ()
        self._rows: dict[int, int] = {}
        self._fresh: dict[int, tuple[Six, int, int]] = {}
        self._states: Array = np.zeros((0, 6))
        self._times = np.zeros(0, dtype=np.int64)
        # Arrival times (µs), independent of the times at which the measurements are dated.
        self._arrivals = np.zeros(0, dtype=np.int64)
        left = fading(config)
        self._fading: Array = np.zeros(0) if left is None else np.ascontiguousarray(left[:, 0])
        self._max_plan_deviation = _MAX_PLAN_DEVIATION if left is None else config.guard.tube
        self._plans = SharedPlans(config, fleet)
        self._table = self._plans.table
        margin = config.field.margin(2)
        self._margin: Array = np.full(_SYSTEM_IDS, margin)
        self._heights: Array = np.full(_SYSTEM_IDS, 1.0 / config.field.downwash)
        self._d_min: Array = np.full(_SYSTEM_IDS, config.field.d_min + margin)
        self._d_safe: Array = np.full(_SYSTEM_IDS, config.field.d_safe + margin)
        self._unheard = None if config.guard.unheard_us is None else Unheard(config)
        self.refused_plans = 0
        self.closest = inf
        """m: least distance to a neighbour so far, by its messages; updated if ``guard.near`` is set."""
        self._brief = False
        self._keeps_mates = isinstance(config.formation, Perception)
        self._planned: dict[int, int] = {}
        # Committed plans are received by the certified avoidance alone.
        self._sees_no_plans = config.avoidance == "certified" and self._keeps_mates
        # Moving obstacles: they may be larger than a vehicle and are not bound by its limits.
        self._moving_obstacles = {one.system for one in config.moving}
        self.relevance = RelevanceFilter(config)
        self._trusted = TrustedPeers()
        self._uncertainty = ReportedUncertainty()
        # Only committed plans keep clear of balls, see ``as_arrived``.
        self._watches_lateness = config.avoidance == "certified"
        self._late: dict[int, tuple[int, Measured]] = {}

    @property
    def brief(self) -> bool:
        """Whether the neighbours' clocks are a simulation's clock, see ``SenderClock``."""
        return self._brief

    @brief.setter
    def brief(self, value: bool) -> None:
        if value != self._brief:
            self._brief = value
            for sender in self._senders.values():
                sender.track.brief = value
            self._plans.brief = value

    def receive_position(self, now: int, message: GlobalPosition) -> None:
        """Receive a neighbour's GLOBAL_POSITION_INT; one with the own system id is ignored."""
        system, component = message.source
        if system == self._system:
            return
        sender = self._senders.get(system)
        changes = sender is not None and sender.component != component
        if changes and sender is not None and sender.prefers(now, component):
            # Another component reports the position already, dated by another clock.
            return
        if sender is None or changes:
            track = Track(self._config.neighbour)
            track.brief = self._brief
        else:
            track = sender.track
        placed = measurement_of(self._fleet, message, self._velocity_up)
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
            self._trusted.restart(now, sender.row)
        sender.track, sender.component = track, component
        if accepted or refused > 0:
            # Unusable positions, such as those of a receiver without a fix, suppress nobody's messages.
            sender.reported = now
        if time != time_before:
            sender.received = now
        self._fresh[sender.row] = belief.x, time, sender.received

    def _note_lateness(self, now: int, system: int, when: int, placed: Measured) -> None:
        """Note the measurement ``placed`` of ``system`` if it seems late; ``when`` (µs): its date."""
        arrived = now - self._config.neighbour.delay_us
        if when < arrived - _LATE_US:
            self._late[system] = arrived, placed
        else:
            self._late.pop(system, None)

    def as_arrived(self) -> list[tuple[int, int, Array, Array]]:
        """Return what ``last_received`` does, dated by arrival, of neighbours whose last message seems late.

        Either the message is late, and ``last_received`` is right; or the sender's clock began anew, and this
        is right, while the dates that contradict each other spoil the track. Nobody can tell for a while.
        """
        return [
            (system, time, np.array(placed[:3]), np.array(placed[3:]))
            for system, (time, placed) in self._late.items()
            if len(placed) == 6
        ]

    def _add(self, now: int, system: int) -> int:
        """Add a row for ``system``, first received at ``now`` (µs); return its index."""
        row = self._rows[system] = len(self._ids)
        self._ids += (system,)
        self._states = np.vstack([self._states, np.zeros(6)])
        self._times = np.append(self._times, now)
        self._arrivals = np.append(self._arrivals, now)
        self._trusted.add(now)
        return row

    def receive_plan(self, now: int, message: Tunnel) -> None:
        """Receive a neighbour's TUNNEL message: its horizon, or the uncertainty of its position.

        A message that cannot be used counts as refused, see ``SharedPlans.receive``.
        """
        system = message.source.system
        if system == self._system or message.payload_type not in (PAYLOAD_TYPE, DOUBT):
            return
        try:
            if message.payload_type == DOUBT:
                self._uncertainty.receive(now, system, message.payload)
            else:
                self._plans.receive(now, system, message.payload)
        except PlanWireError:
            self.refused_plans += 1

    def listen(self, now: int, own: State | None) -> None:
        """Determine the neighbours to ignore for a while; ``own`` is the own state at ``now`` (µs)."""
        self._update_rows()
        self.relevance.look(own, self._ids, self._states, now - self._times, self._trusted_rows)

    def ignores(self, system: int, component: int) -> bool:
        """Return whether position and plan messages of this sender need not be decoded now."""
        if not self.relevance.ignores(system):
            return False
        sender = self._senders.get(system)
        if sender is not None and component == sender.component:
            # The ignored messages still have priority over those of other components.
            sender.reported = self.relevance.now
        return True

    def _trusted_rows(self) -> NDArray[np.bool_]:
        """Return which rows (M,) are trusted for a while: vehicles with plans and limits like the own."""
        trusted = self._trusted.consistent(self.relevance.now)
        if not trusted.any():
            return trusted
        trusted &= follows(self._states, self._table.at(self._ids, self._times))
        for system in self._moving_obstacles | self._uncertainty.systems(self.relevance.now):
            if system in self._rows:
                trusted[self._rows[system]] = False
        return trusted

    def obstacles(self, now: int, places: Array | None = None) -> Obstacles:
        """Return all neighbours aligned with ``now + n·dt``, n = 0…N.

        With ``places`` (P, 3) only those are returned that may affect a plan that begins at one of them.

        A neighbour that falls silent remains an obstacle at its last position, extrapolated for a bounded
        time. With ``guard.flown_on_us`` the vehicle may have stopped, or its autopilot may have flown on: the
        obstacle then covers the whole path between (``flown_on``). A measurement with an old date that
        arrived only now was delayed, or is dated by a clock that has restarted and is not synchronised yet:
        then the obstacle covers both the reported and the extrapolated position, unless the neighbour's plan
        is near one of them at ``now``; that plan is then used.
        """
        config, stale = self._config, self._config.guard.plan_stale_us
        steps = config.horizon.steps + 1
        self._update_rows()
        age = now - self._times
        ids, states, times, arrivals = self._ids, self._states, self._times, self._arrivals
        doubtful = self._uncertainty.systems(now)
        if places is not None and ids:
            near = self.relevance.near(places, states, age)
            for system in self._moving_obstacles | doubtful:
                if system in self._rows:
                    near[self._rows[system]] = True
            if np.count_nonzero(near) < len(ids):
                ids = tuple(compress(ids, near.tolist()))
                age, states, times, arrivals = age[near], states[near], times[near], arrivals[near]
        if not ids:
            return Obstacles((), np.empty((0, steps, 3)), np.empty(0), np.empty(0))
        positions, trusted = self._table.positions(ids, now, now - stale)
        here, silent = np.empty((len(ids), 3)), age > stale
        extrapolate(states, age, config.neighbour.extrapolate_us, here)
        count, deviation = len(ids), self._max_plan_deviation
        further: Array | None = None
        if np.count_nonzero(silent):
            # Late: a message has arrived recently, but its date is old. A neighbour that has just fallen
            # silent is not late.
            begins, late = positions[:, 0], silent & (now - arrivals <= stale - config.neighbour.delay_us)
            beside = late & (within(begins, states[:, 0:3], deviation) | within(begins, here, deviation))
            held = silent if config.guard.flown_on_us else late
            if np.count_nonzero(held):
                names, further = tuple(compress(ids, held.tolist())), np.zeros(count)
                here[held], further[held] = self._held(
                    names, states[held], times[held], age[held], late[held]
                )
            trusted &= beside | (~late & within(begins, here, deviation))
            deviation = inf
        # A neighbour that is silent for longer than it is extrapolated rests where the extrapolation ended.
        moves = config.neighbour_prediction == "velocity"
        most, step = config.neighbour.extrapolate_us if moves else -1, 1e-6 * config.horizon.dt_us
        align(states, age, here, silent, deviation, self._fading, step, most, positions, trusted)
        found = Obstacles(
            ids,
            positions,
            self._d_min[:count],
            self._d_safe[:count],
            self._margin[:count],
            self._heights[:count],
        )
        if further is not None:
            further[trusted] = 0.0
        if doubtful:
            # Plans, too, begin at the neighbour's own estimate of its position.
            radii = self._uncertainty.radii(ids)
            further = radii if further is None else further + radii
        if self._unheard is not None:
            unsure = self._unheard.radii(age)
            further = unsure if further is None else further + unsure
        if further is None or not further.any():
            return found
        return found._replace(
            d_min=found.d_min + further, d_safe=found.d_safe + further, radius=found.radius + further
        )

    def _held(
        self, ids: Sequence[int], states: Array, times: Ages, ages: Ages, late: NDArray[np.bool_]
    ) -> Ball:
        """Return balls that contain all places where vehicles with the last ``states`` (M, 6) may be.

        The balls reach from the last certain position (for ``late`` ones: from the reported one) to where the
        vehicle may have flown. ``times``, ``ages`` (M,) in µs.
        """
        guard = self._config.guard
        most = 1e-6 * np.minimum(ages, guard.flown_on_us or self._config.neighbour.extrapolate_us)
        meant = np.zeros((len(ids), 3))
        if guard.flown_on_us:
            meant = limit(self._table.accelerations(ids, times), self._config.limits.a_total)
        return flown_on(states, meant, most, np.where(late, 0.0, 1e-6 * guard.plan_stale_us))

    def bounds(self, now: int, place: Array) -> SpeedBounds | None:
        """Return the bounds on the speed of a vehicle at ``place`` (3,), m, beside unheard neighbours.

        Returns None if there is none, or without ``guard.unheard_us``, see ``Unheard``.
        """
        if self._unheard is None or not self._ids:
            return None
        self._update_rows()
        return self._unheard.bounds(now, self._heard(now), place)

    def _heard(self, now: int) -> Heard:
        """Return what was heard last of all neighbours: a state, or the beginning of a plan."""
        ages, states = now - self._times, self._states.copy()
        begun, starts = self._table.starts(self._ids)
        # A plan counts if its sender can have come there since its last position.
        flown = 1e-6 * np.maximum(begun - self._times, 0) * hypot(*self._config.limits.fastest)
        planned = (begun > self._times) & (begun <= now)
        planned &= within(starts[:, 0:3], states[:, 0:3], _MAX_PLAN_DEVIATION + flown)
        ages[planned], states[planned] = now - begun[planned], starts[planned]
        return Heard(ages, states, planned)

    def nearest(self, now: int, own: State | None) -> tuple[int, float] | None:
        """Return system id and distance (m) of the neighbour nearest to the ``own`` position.

        It is the distance to the extrapolated track. Returns None without an own state, without
        ``guard.near`` or without neighbours.
        """
        if own is None or self._config.guard.near is None or not self._ids:
            return None
        self._update_rows()
        age = np.minimum(np.maximum(now - self._times, 0), self._config.neighbour.extrapolate_us)
        off = self._states[:, 0:3] + 1e-6 * age[:, None] * self._states[:, 3:6] - own.position
        distance = np.sqrt(np.vecdot(off, off))
        index = int(np.argmin(distance))
        nearest = float(distance[index])
        self.closest = min(self.closest, nearest)
        return self._ids[index], nearest

    @property
    def below(self) -> int:
        """Number of vehicles received so far whose system id is smaller than the own."""
        return sum(system < self._system for system in self._ids if system not in self._moving_obstacles)

    def mates(self, now: int) -> Mates:
        """Return the vehicles that fly by plans of their own.

        These are the ones with a fresh plan.
        """
        self._update_rows()
        if not self._ids:
            return Mates()
        fresh = self._planning(now)
        if self._keeps_mates:
            fresh |= self._planned_lately(now, fresh)
        age = np.minimum(np.maximum(now - self._times[fresh], 0), self._config.neighbour.extrapolate_us)
        states = self._states[fresh]
        ids = tuple(compress(self._ids, fresh.tolist()))
        return Mates(ids, np.asarray(states[:, 0:3] + 1e-6 * age[:, None] * states[:, 3:6]))

    def mate_ids(self, now: int) -> frozenset[int]:
        """Return the system ids of the vehicles that fly by plans of their own."""
        self._update_rows()
        return frozenset(compress(self._ids, self._planning(now).tolist())) if self._ids else frozenset()

    def _planned_lately(self, now: int, planning: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return, for each neighbour, whether its plan was fresh in the last ``_FLEET_US``.

        ``planning`` (M,): whether it is fresh at ``now`` (µs). Otherwise neighbours would leave the
        formation and come back every few seconds on a link that loses messages.
        """
        for system in compress(self._ids, planning.tolist()):
            self._planned[system] = now
        lately = [now - self._planned.get(system, now - _FLEET_US - 1) <= _FLEET_US for system in self._ids]
        return np.array(lately) & (now - self._times <= _FLEET_US)

    def _planning(self, now: int) -> NDArray[np.bool_]:
        """Return, for each neighbour, whether it flies by plans of its own."""
        stale = self._config.guard.plan_stale_us
        if self._sees_no_plans:
            # A companion that reports a fresh position counts as flying by plans.
            fresh = np.array([not self._senders[system].by_autopilot for system in self._ids])
            fresh &= now - self._times <= stale
        else:
            _, fresh = self._table.positions(self._ids, now, now - stale)
        for system in self._moving_obstacles & self._rows.keys():
            fresh[self._rows[system]] = False
        return fresh

    def when(self, system: int, now: int, stamp: int) -> int | None:
        """Return when (µs) what a companion stamped with ``stamp`` (µs, 0 for none) was true.

        It arrived at ``now`` (µs). Returns None for a stamp from the future, and for a system that is no
        vehicle of the fleet: whose companion does not report a fresh position.
        """
        sender = self._senders.get(system)
        if sender is None or sender.by_autopilot or system in self._moving_obstacles:
            return None
        time = sender.track.time
        if time is None or now - time > _FLEET_US:
            return None
        return sender.track.dated(now, stamp)

    def last_received(self, without: Set[int] = frozenset()) -> list[tuple[int, int, Array, Array]]:
        """Return system id, time (µs), position (3,) and velocity (3,) of each neighbour's last state.

        Systems in ``without`` are left out.
        """
        self._update_rows()
        times, states = self._times, self._states
        return [
            (system, int(times[row]), states[row, 0:3], states[row, 3:6])
            for row, system in enumerate(self._ids)
            if system not in without
        ]

    def ages(self, now: int) -> dict[int, int]:
        """Return the age (µs) of each neighbour's track, by system id."""
        self._update_rows()
        return dict(zip(self._ids, (now - self._times).tolist(), strict=True))

    def _update_rows(self) -> None:
        """Update the rows of the neighbours received since the last update."""
        if not self._fresh:
            return
        rows = np.array(list(self._fresh))
        states, self._times[rows], self._arrivals[rows] = zip(*self._fresh.values(), strict=True)
        # Twice as fast as an array of tuples.
        self._states[rows] = np.fromiter(chain.from_iterable(states), np.float64).reshape(-1, 6)
        self._fresh.clear()
