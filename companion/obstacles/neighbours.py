"""Other vehicles, and moving obstacles, received on the swarm link, as obstacles: tracks and shared horizons.

A neighbour that shares no horizon, or whose horizon is stale or no longer agrees with its position, is taken
at its n = 0 position for the whole horizon (Sec. IV-A), or extrapolated at constant velocity if so
configured.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from itertools import compress
from math import hypot, inf

import numpy as np
from numpy.typing import NDArray

from companion.config import CompanionConfig
from companion.config.formation import Perception
from companion.estimation.tracks import State
from companion.obstacles.alignment import align, extrapolate, within
from companion.obstacles.neighbour_tracks import FLEET_US, NeighbourTracks
from companion.obstacles.reachable_ball import Ball, flown_on
from companion.obstacles.relevance_filter import Ages, RelevanceFilter
from companion.obstacles.shared_plans import SharedPlans
from companion.obstacles.trusted_peers import follows
from companion.obstacles.uncertainty import ReportedUncertainty
from companion.obstacles.unheard import Heard, Unheard
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
_MAX_PLAN_DEVIATION = 1.0
"""m; if a neighbour is further than this from its plan, its track is used instead of the plan.

With ``guard.astray_us`` the limit is ``guard.tube``.
"""


def fading(config: CompanionConfig) -> Array | None:
    """Return the share (N + 1, 1) of a vehicle's present deviation from its plan that is left at n = 0…N.

    Returns None if ``guard.astray_us`` is off.
    """
    if not config.guard.astray_us:
        return None
    ahead = config.horizon.dt_us * np.arange(config.horizon.steps + 1.0)
    return np.asarray(np.exp(-ahead / config.guard.astray_us))[:, None]


class Neighbours:
    """Everything received on the swarm link, by system id."""

    def __init__(self, config: CompanionConfig, system: int, fleet: FleetFrame) -> None:
        self._config = config
        self._system = system
        self._tracks = NeighbourTracks(config, fleet)
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
        self._keeps_mates = isinstance(config.formation, Perception)
        self._planned: dict[int, int] = {}
        # Committed plans are received by the certified avoidance alone.
        self._sees_no_plans = config.avoidance == "certified" and self._keeps_mates
        # Moving obstacles: they may be larger than a vehicle and are not bound by its limits.
        self._moving_obstacles = {one.system for one in config.moving}
        self.relevance = RelevanceFilter(config)
        self._uncertainty = ReportedUncertainty()

    @property
    def brief(self) -> bool:
        """Whether the neighbours' clocks are a simulation's clock, see ``SenderClock``."""
        return self._tracks.brief

    @brief.setter
    def brief(self, value: bool) -> None:
        if value != self._tracks.brief:
            self._tracks.brief = self._plans.brief = value

    def receive_position(self, now: int, message: GlobalPosition) -> None:
        """Receive a neighbour's GLOBAL_POSITION_INT; one with the own system id is ignored."""
        if message.source.system != self._system:
            self._tracks.receive(now, message)

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
        ids, states, times, _ = self._tracks.last_states()
        self.relevance.look(own, ids, states, now - times, self._trusted_rows)

    def ignores(self, system: int, component: int) -> bool:
        """Return whether position and plan messages of this sender need not be decoded now."""
        if not self.relevance.ignores(system):
            return False
        # The ignored messages still have priority over those of other components.
        self._tracks.skip(self.relevance.now, system, component)
        return True

    def _trusted_rows(self) -> NDArray[np.bool_]:
        """Return which rows (M,) are trusted for a while: vehicles with plans and limits like the own."""
        trusted = self._tracks.trusted.consistent(self.relevance.now)
        if not trusted.any():
            return trusted
        ids, states, times, _ = self._tracks.last_states()
        trusted &= follows(states, self._table.at(ids, times))
        for system in self._moving_obstacles | self._uncertainty.systems(self.relevance.now):
            if system in self._tracks.rows:
                trusted[self._tracks.rows[system]] = False
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
        ids, states, times, arrivals = self._tracks.last_states()
        age = now - times
        doubtful = self._uncertainty.systems(now)
        if places is not None and ids:
            near = self.relevance.near(places, states, age)
            for system in self._moving_obstacles | doubtful:
                if system in self._tracks.rows:
                    near[self._tracks.rows[system]] = True
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
        if self._unheard is None or not self._tracks.rows:
            return None
        return self._unheard.bounds(now, self._heard(now), place)

    def _heard(self, now: int) -> Heard:
        """Return what was heard last of all neighbours: a state, or the beginning of a plan."""
        ids, states, times, _ = self._tracks.last_states()
        ages, states = now - times, states.copy()
        begun, starts = self._table.starts(ids)
        # A plan counts if its sender can have come there since its last position.
        flown = 1e-6 * np.maximum(begun - times, 0) * hypot(*self._config.limits.fastest)
        planned = (begun > times) & (begun <= now)
        planned &= within(starts[:, 0:3], states[:, 0:3], _MAX_PLAN_DEVIATION + flown)
        ages[planned], states[planned] = now - begun[planned], starts[planned]
        return Heard(ages, states, planned)

    def nearest(self, now: int, own: State | None) -> tuple[int, float] | None:
        """Return system id and distance (m) of the neighbour nearest to the ``own`` position.

        It is the distance to the extrapolated track. Returns None without an own state, without
        ``guard.near`` or without neighbours.
        """
        if own is None or self._config.guard.near is None or not self._tracks.rows:
            return None
        ids, states, times, _ = self._tracks.last_states()
        age = np.minimum(np.maximum(now - times, 0), self._config.neighbour.extrapolate_us)
        off = states[:, 0:3] + 1e-6 * age[:, None] * states[:, 3:6] - own.position
        distance = np.sqrt(np.vecdot(off, off))
        index = int(np.argmin(distance))
        nearest = float(distance[index])
        self.closest = min(self.closest, nearest)
        return ids[index], nearest

    @property
    def below(self) -> int:
        """Number of vehicles received so far whose system id is smaller than the own."""
        return sum(system < self._system for system in self._tracks.rows.keys() - self._moving_obstacles)

    def mates(self, now: int) -> Mates:
        """Return the vehicles that fly by plans of their own.

        These are the ones with a fresh plan.
        """
        ids, states, times, _ = self._tracks.last_states()
        if not ids:
            return Mates()
        fresh = self._planning(now)
        if self._keeps_mates:
            fresh |= self._planned_lately(now, fresh)
        age = np.minimum(np.maximum(now - times[fresh], 0), self._config.neighbour.extrapolate_us)
        states = states[fresh]
        return Mates(
            tuple(compress(ids, fresh.tolist())),
            np.asarray(states[:, 0:3] + 1e-6 * age[:, None] * states[:, 3:6]),
        )

    def mate_ids(self, now: int) -> frozenset[int]:
        """Return the system ids of the vehicles that fly by plans of their own."""
        ids = self._tracks.rows
        return frozenset(compress(ids, self._planning(now).tolist())) if ids else frozenset()

    def _planned_lately(self, now: int, planning: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return, for each neighbour, whether its plan was fresh in the last ``FLEET_US``.

        ``planning`` (M,): whether it is fresh at ``now`` (µs). Otherwise neighbours would leave the
        formation and come back every few seconds on a link that loses messages.
        """
        ids, _, times, _ = self._tracks.last_states()
        for system in compress(ids, planning.tolist()):
            self._planned[system] = now
        lately = [now - self._planned.get(system, now - FLEET_US - 1) <= FLEET_US for system in ids]
        return np.array(lately) & (now - times <= FLEET_US)

    def _planning(self, now: int) -> NDArray[np.bool_]:
        """Return, for each neighbour, whether it flies by plans of its own."""
        stale = self._config.guard.plan_stale_us
        ids, _, times, _ = self._tracks.last_states()
        if self._sees_no_plans:
            # A companion that reports a fresh position counts as flying by plans.
            fresh = np.array([not self._tracks.by_autopilot(system) for system in ids])
            fresh &= now - times <= stale
        else:
            _, fresh = self._table.positions(ids, now, now - stale)
        for system in self._moving_obstacles & self._tracks.rows.keys():
            fresh[self._tracks.rows[system]] = False
        return fresh

    def when(self, system: int, now: int, stamp: int) -> int | None:
        """Return when (µs) what a companion stamped with ``stamp`` (µs, 0 for none) was true.

        It arrived at ``now`` (µs). Returns None for a stamp from the future, and for a system that is no
        vehicle of the fleet: whose companion does not report a fresh position.
        """
        return None if system in self._moving_obstacles else self._tracks.when(system, now, stamp)

    def last_received(self, without: Set[int] = frozenset()) -> list[tuple[int, int, Array, Array]]:
        """Return system id, time (µs), position (3,) and velocity (3,) of each neighbour's last state.

        Systems in ``without`` are left out.
        """
        return self._tracks.last_received(without)

    def turn_rates(self) -> dict[int, float]:
        """Return the turn rates (rad/s, counter-clockwise from above) of the last states, by system id.

        They are 0 unless ``neighbour.sigma_turn`` is set.
        """
        return self._tracks.turn_rates()

    def as_arrived(self) -> list[tuple[int, int, Array, Array]]:
        """Return what ``last_received`` does, dated by arrival, where the last message seems late.

        See ``NeighbourTracks.as_arrived``.
        """
        return self._tracks.as_arrived()

    def ages(self, now: int) -> dict[int, int]:
        """Return the age (µs) of each neighbour's track, by system id."""
        ids, _, times, _ = self._tracks.last_states()
        return dict(zip(ids, (now - times).tolist(), strict=True))
