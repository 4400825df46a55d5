"""The other vehicles, and obstacles that move, as the swarm link tells of them: a track each, and the horizon
each has shared.

A neighbour that shares no horizon, or whose horizon is old or no longer where the neighbour is, is taken at
its n = 0 position for the whole horizon (Sec. IV-A), or carried on at constant velocity if so configured.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import compress
from math import inf

import numpy as np
from numpy.typing import NDArray

from companion.config import CompanionConfig
from companion.estimation.estimator import Measured
from companion.estimation.plan_clock import PlanClock
from companion.estimation.tracks import State, Track, measured
from companion.obstacles.reachable_ball import Ball, flown_on
from companion.obstacles.relevance_filter import Ages, RelevanceFilter
from companion.obstacles.trusted_peers import TrustedPeers
from companion.obstacles.uncertainty import ReportedUncertainty
from companion.values.components import AUTOPILOT
from companion.values.horizon import Array, Horizon, HorizonTable, roll_out
from companion.values.obstacles import Obstacles
from companion.values.vectors import limit
from mavlink_bridge.errors import PlanWireError
from mavlink_bridge.frames import FleetFrame, ned_to_enu
from mavlink_bridge.messages import GlobalPosition, Tunnel
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, unpack
from mavlink_bridge.wire.uncertainty import PAYLOAD_TYPE as DOUBT

_MOST = 255
"""System ids that there are."""
_VOICE = 1_000_000
"""µs for which a vehicle's autopilot is not listened to where its companion speaks, too."""
_STRAYED = 1.0
"""A neighbour further than this (m) from its own plan is not where it says: its track counts. With
``guard.astray_us`` it is ``guard.tube``."""


@lru_cache(maxsize=1024)
def _read(payload: bytes) -> tuple[int, Horizon]:
    """Fingerprint and horizon of a plan on the wire. Where many companions share a process each plan is read
    once. Raises PlanWireError."""
    plan = unpack(payload)
    horizon = roll_out(plan.epoch, plan.dt, plan.position_m, plan.velocity_m_s, plan.accelerations_m_s2)
    horizon.knots.flags.writeable = False
    return plan.origin, horizon


@lru_cache(maxsize=1024)
def _placed(fleet: FleetFrame, message: GlobalPosition, upward: bool) -> Measured | None:
    """What a message measures, as ``measured`` has it; each worked out once in a process."""
    position = fleet.to_enu(message.latitude, message.longitude, message.altitude)
    return measured(position, ned_to_enu(message.velocity_ned), upward=upward)


def fading(config: CompanionConfig) -> Array | None:
    """How much (N + 1, 1) is left, at n = 0…N, of what a vehicle is beside its plan now; None where that does
    not count."""
    if not config.guard.astray_us:
        return None
    ahead = config.horizon.dt_us * np.arange(config.horizon.steps + 1.0)
    return np.asarray(np.exp(-ahead / config.guard.astray_us))[:, None]


class Neighbours:
    """Everything heard on the swarm link, by system id."""

    def __init__(self, config: CompanionConfig, system: int, fleet: FleetFrame) -> None:
        self._config = config
        self._system = system
        self._fleet = fleet
        self._tracks: dict[int, Track] = {}
        # The tracks' last states as rows, in the order of the tracks: sampled together at every plan, where
        # those of the fresh ones are put down first.
        self._ids: tuple[int, ...] = ()
        self._rows: dict[int, int] = {}
        self._fresh: set[int] = set()
        self._states: Array = np.zeros((0, 6))
        self._times = np.zeros(0, dtype=np.int64)
        # When (µs) they came, whatever they are dated.
        self._came: dict[int, int] = {}
        self._arrivals = np.zeros(0, dtype=np.int64)
        self._clocks: dict[int, PlanClock] = {}
        self._fading = fading(config)
        self._strayed = _STRAYED if self._fading is None else config.guard.tube
        self._table = HorizonTable(config.horizon.steps + 1, config.horizon.dt_us)
        margin = config.field.margin(2)
        self._margin: Array = np.full(_MOST, margin)
        self._d_min: Array = np.full(_MOST, config.field.d_min + margin)
        self._d_safe: Array = np.full(_MOST, config.field.d_safe + margin)
        self.refused_plans = 0
        self.closest = inf
        """m: how near a neighbour has been, by what was heard of it; looked at where ``guard.near`` is."""
        # When (µs) a vehicle's companion last said where it is; whether its track is of its autopilot's word.
        self._spoken: dict[int, int] = {}
        self._by_autopilot: dict[int, bool] = {}
        self._brief = False
        # What is larger than a vehicle, and flies by no limits.
        self._things = {one.system for one in config.moving}
        self.relevance = RelevanceFilter(config)
        self._trusted = TrustedPeers()
        self._uncertainty = ReportedUncertainty()

    @property
    def brief(self) -> bool:
        """Whether their clocks are a simulation's, see ``SenderClock``."""
        return self._brief

    @brief.setter
    def brief(self, value: bool) -> None:
        if value != self._brief:
            self._brief = value
            for track in self._tracks.values():
                track.brief = value
            for clock in self._clocks.values():
                clock.brief = value

    def receive_position(self, now: int, message: GlobalPosition) -> None:
        """A neighbour's GLOBAL_POSITION_INT; the own echo is ignored."""
        system, component = message.source
        if system == self._system:
            return
        by_autopilot = component == AUTOPILOT
        if by_autopilot and now - self._spoken.get(system, now - _VOICE) < _VOICE:
            # Its companion says it already, by another clock.
            return
        track = self._tracks.get(system)
        if track is None or self._by_autopilot[system] != by_autopilot:
            track = Track(self._config.neighbour)
            track.brief = self._brief
        placed = _placed(self._fleet, message, self._config.neighbour.velocity_up)
        refused, before = track.refused, track.time
        told = track.take(now, placed, message.time_boot) or track.refused > refused
        if told and not by_autopilot:
            # What is of no use, as of a receiver without a fix, keeps nobody's word out.
            self._spoken[system] = now
        if track.time is None:
            return
        if track.time != before:
            self._came[system] = now
        if system not in self._rows:
            self._rows[system] = len(self._ids)
            self._ids += (system,)
            self._states = np.vstack([self._states, np.zeros(6)])
            self._times = np.append(self._times, now)
            self._arrivals = np.append(self._arrivals, now)
        self._tracks[system], self._by_autopilot[system] = track, by_autopilot
        self._fresh.add(system)
        self._trusted.note(now, self._rows[system], track)

    def receive_plan(self, now: int, message: Tunnel) -> None:
        """What a neighbour tells in a TUNNEL: its horizon, or how far it may be from where it says that it
        is. A horizon in another fleet frame, from the future or from long ago is refused, unless it is the
        sender's clock that is wrong."""
        system = message.source.system
        if system == self._system or message.payload_type not in (PAYLOAD_TYPE, DOUBT):
            return
        try:
            if message.payload_type == DOUBT:
                self._uncertainty.receive(now, system, message.payload)
                return
            origin, horizon = _read(message.payload)
        except PlanWireError:
            self.refused_plans += 1
            return
        begins = None
        if origin == self._fleet.fingerprint and len(horizon.knots) > 1:
            clock = self._clocks.get(system)
            if clock is None:
                config = self._config
                clock = PlanClock(config.neighbour.delay_us, config.guard.plan_stale_us)
                clock.brief = self._brief
                self._clocks[system] = clock
            begins = clock.begins(now, horizon.epoch, horizon.dt)
        if begins is None:
            self.refused_plans += 1
            return
        if begins != horizon.epoch:
            horizon = Horizon(begins, horizon.dt, horizon.knots)
        self._table.put(system, horizon)

    def listen(self, now: int, own: State | None) -> None:
        """Find out whom to ignore for a while, the ``own`` state being what it is at ``now`` (µs)."""
        self._put_down()
        self.relevance.look(own, self._ids, self._states, now - self._times, self._familiar)

    def ignores(self, system: int, component: int) -> bool:
        """Whether what this sender says of where it is and will be need not be decoded now."""
        if not self.relevance.ignores(system):
            return False
        if component != AUTOPILOT and not self._by_autopilot.get(system, True):
            # It goes on being its vehicle's voice.
            self._spoken[system] = self.relevance.now
        return True

    def _familiar(self) -> NDArray[np.bool_]:
        """Whose word counts for a while, as of vehicles that fly by plans and limits like ours."""
        plans = self._table.at(self._ids, self._times)
        trusted = self._trusted.trusted(self.relevance.now, self._states, plans)
        for system in self._things | self._uncertainty.systems(self.relevance.now):
            if system in self._rows:
                trusted[self._rows[system]] = False
        return trusted

    def obstacles(self, now: int, places: Array | None = None) -> Obstacles:
        """All neighbours aligned with ``now + n·dt``, n = 0…N; only those that may act on a plan that begins
        at one of ``places`` (P, 3), if those are said.

        One that falls silent stays an obstacle where it was last, carried on for a bounded time: it may well
        be there. With ``guard.flown_on_us`` it may have stopped, or its autopilot flown on: it is an obstacle
        that holds all of that way (``flown_on``). What is dated long ago and came only now has been delayed,
        or it is a clock that is not understood yet, of one that began anew: both where it says that it is and
        where that has been carried to are held, and a plan that passes one of them counts.
        """
        config, stale = self._config, self._config.guard.plan_stale_us
        steps = config.horizon.steps + 1
        self._put_down()
        age = now - self._times
        ids, states, times, since = self._ids, self._states, self._times, now - self._arrivals
        doubtful = self._uncertainty.systems(now)
        if places is not None and ids:
            near = self.relevance.near(places, states, age)
            for system in self._things | doubtful:
                if system in self._rows:
                    near[self._rows[system]] = True
            if not near.all():
                ids = tuple(compress(ids, near.tolist()))
                age, states, times, since = age[near], states[near], times[near], since[near]
        if not ids:
            return Obstacles((), np.empty((0, steps, 3)), np.empty(0), np.empty(0))
        carried = np.minimum(np.maximum(age, 0), config.neighbour.extrapolate_us) * 1e-6
        here = states[:, 0:3] + carried[:, None] * states[:, 3:6]
        further = np.zeros(len(ids))
        positions, trusted = self._table.positions(ids, now, now - stale)
        begins, silent = positions[:, 0], age > stale
        if silent.any():
            # By more than every message is: who has just fallen silent is not late.
            late = silent & (since <= stale - config.neighbour.delay_us)
            beside = late & (
                _beside(begins, states[:, 0:3], self._strayed) | _beside(begins, here, self._strayed)
            )
            held = silent if config.guard.flown_on_us else late
            if held.any():
                names = tuple(compress(ids, held.tolist()))
                here[held], further[held] = self._held(
                    names, states[held], times[held], age[held], late[held]
                )
            trusted &= beside | (~late & _beside(begins, here, self._strayed))
        else:
            trusted &= _beside(begins, here, self._strayed)
        if self._fading is not None:
            # Beside its plan, and on the way back to it.
            positions += np.where(trusted & ~silent, 1.0, 0.0)[:, None, None] * (
                self._fading * (here - begins)[:, None, :]
            )
        if not trusted.all():
            lost = ~trusted
            positions[lost] = here[lost][:, None]
            if config.neighbour_prediction == "velocity":
                # One that has been silent for longer than it is carried on rests where that ended.
                moving = lost & (age <= config.neighbour.extrapolate_us)
                ahead = 1e-6 * config.horizon.dt_us * np.arange(steps)
                positions[moving] += ahead[:, None] * states[moving, None, 3:6]
        count = len(ids)
        found = Obstacles(ids, positions, self._d_min[:count], self._d_safe[:count], self._margin[:count])
        further[trusted] = 0.0
        if doubtful:
            # Plans, too, lead from where it believes to be.
            further += self._uncertainty.radii(ids)
        if not further.any():
            return found
        return found._replace(
            d_min=found.d_min + further, d_safe=found.d_safe + further, radius=found.radius + further
        )

    def _held(
        self, ids: Sequence[int], states: Array, times: Ages, ages: Ages, late: NDArray[np.bool_]
    ) -> Ball:
        """Between where those with last ``states`` (M, 6) were when it could still be known, of ``late`` ones
        where that was said, and where they may be by now; ``times``, ``ages`` (M,) µs."""
        guard = self._config.guard
        most = 1e-6 * np.minimum(ages, guard.flown_on_us or self._config.neighbour.extrapolate_us)
        meant = np.zeros((len(ids), 3))
        if guard.flown_on_us:
            meant = limit(self._table.accelerations(ids, times), self._config.limits.a_total)
        return flown_on(states, meant, most, np.where(late, 0.0, 1e-6 * guard.plan_stale_us))

    def nearest(self, now: int, own: State | None) -> tuple[int, float] | None:
        """The neighbour that is nearest to the ``own`` place by what was heard of it, and how near (m); None
        without any in the air. What stands on the ground is nobody's concern."""
        if own is None or self._config.guard.near is None or not self._ids:
            return None
        self._put_down()
        age = np.minimum(np.maximum(now - self._times, 0), self._config.neighbour.extrapolate_us)
        off = self._states[:, 0:3] + 1e-6 * age[:, None] * self._states[:, 3:6] - own.position
        distance = np.sqrt(np.vecdot(off, off))
        index = int(np.argmin(distance))
        nearest = float(distance[index])
        self.closest = min(self.closest, nearest)
        return self._ids[index], nearest

    @property
    def below(self) -> int:
        """How many of those heard so far have a smaller system id than the own."""
        return sum(system < self._system for system in self._ids if system not in self._things)

    def mates(self, now: int) -> Array:
        """Where the vehicles are (M, 3) that fly by plans of their own: whose plan is fresh."""
        self._put_down()
        if not self._ids:
            return np.empty((0, 3))
        fresh = self._planning(now)
        age = np.minimum(np.maximum(now - self._times[fresh], 0), self._config.neighbour.extrapolate_us)
        states = self._states[fresh]
        return np.asarray(states[:, 0:3] + 1e-6 * age[:, None] * states[:, 3:6])

    def mate_ids(self, now: int) -> frozenset[int]:
        """Their system ids."""
        self._put_down()
        return frozenset(compress(self._ids, self._planning(now).tolist())) if self._ids else frozenset()

    def _planning(self, now: int) -> NDArray[np.bool_]:
        """Of each neighbour, whether it flies by plans of its own."""
        _, fresh = self._table.positions(self._ids, now, now - self._config.guard.plan_stale_us)
        for system in self._things & self._rows.keys():
            fresh[self._rows[system]] = False
        return fresh

    def last_heard(self) -> list[tuple[int, int, Array, Array]]:
        """System id, time (µs), position (3,) and velocity (3,) of everybody's last known state."""
        self._put_down()
        return [
            (system, int(time), state[0:3], state[3:6])
            for system, time, state in zip(self._ids, self._times, self._states, strict=True)
        ]

    def ages(self, now: int) -> dict[int, int]:
        """Age (µs) of every neighbour's track."""
        self._put_down()
        return dict(zip(self._ids, (now - self._times).tolist(), strict=True))

    def _put_down(self) -> None:
        """The states of those who were heard since."""
        if not self._fresh:
            return
        rows = [self._rows[system] for system in self._fresh]
        tracks = [self._tracks[system] for system in self._fresh]
        self._states[rows] = [track.last for track in tracks]
        self._times[rows] = [track.time or 0 for track in tracks]
        self._arrivals[rows] = [self._came[system] for system in self._fresh]
        self._fresh.clear()


def _beside(planned: Array, places: Array, strayed: float) -> NDArray[np.bool_]:
    """Which (M,) of the ``planned`` places (M, 3) are within ``strayed`` (m) of those, so that the plan
    counts."""
    off = planned - places
    return np.asarray(np.vecdot(off, off) <= strayed**2)
