"""Relevance filter: skips messages of neighbours that are too distant to affect the own plans.

The bound: a neighbour affects a vehicle's plan if, at some time within the horizon H, it is nearer than
``reach``: the distance at which the field, the tangential band and the field of approach angles act when the
two close at c, the sum of both speeds. Neither vehicle is faster than v, the norm of ``limits.fastest``, so
c = 2 v. Consider a neighbour at a distance d from the own position, where its state is ``age`` old and the
own state ``own_age``, and where it may be ``_MAX_PLAN_OFFSET`` off its plan. Until the end of the plans that
are made within S + P from now, both approach by at most c·(S + P + H) + v·(``age`` + ``own_age``). So it is
ignored for at most

    S = (d − reach(c) − v·(age + own_age) − _MAX_PLAN_OFFSET) / c − P − H

P is twice the longer of the own state and plan periods: one message may be lost, and the next one is still
received in time. Neighbours are assumed to send at the same rates. No neighbour is ignored when its last
state is older than 0.7 s, ``neighbour.extrapolate_us`` or a quarter of ``guard.neighbour_lost_us``: the
displayed ages remain those of a neighbour that is present.

Only trusted peers (``trusted_peers``) that were not measured to be faster than v are ignored, and none while
the own position is unknown or the own speed exceeds v. ``near`` selects the neighbours for a plan by the same
bound, with their measured speeds where these exceed v. It also keeps those above or below the own position at
any height, because vehicles land straight down. The certified mode receives and uses all messages, since
there the commitments of a neighbour count and not its position; so does the swivel method, which uses all
bearings, and a perception formation with fused detections, which uses all bearings and counts the positions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from companion.config import CompanionConfig
from companion.config.formation import Perception
from companion.config.planning import FADING, MethodName
from companion.config.target_source import FusedSource
from companion.estimation.tracks import State
from companion.obstacles.reachable_ball import further, norms
from companion.values.compiled import (
    BOOL,
    FLOAT,
    INT,
    VOID,
    array,
    kernel,
    output,
    part,
    several,
)
from companion.values.horizon import Array

Ages = NDArray[np.int64]
_MAX_AGE_US = 700_000
"""µs, largest age of the last state of an ignored neighbour.

It is less than the second (``neighbours``) after which the positions of a vehicle's autopilot are used
instead of those of its silent companion.
"""
_MAX_PLAN_OFFSET = 1.0
"""m between a trusted plan and its sender's track, at most."""


class RelevanceFilter:
    """Relevance filter of one companion.

    All times are µs on its clock; ``now`` must be set before headers are checked.
    """

    def __init__(self, config: CompanionConfig) -> None:
        self._config = config
        self._max_speed = hypot(*config.limits.fastest)
        self._horizon_s = 1e-6 * config.horizon.dt_us * (config.horizon.steps + 1)
        self._message_gap_s = 2e-6 * max(config.rates.state_us, config.rates.plan_us)
        self._max_age_s = 1e-6 * min(
            _MAX_AGE_US, config.neighbour.extrapolate_us, config.guard.neighbour_lost_us // 4
        )
        if config.guard.unheard_us is not None:
            # Neighbours that are ignored must not count as unheard.
            self._max_age_s = min(self._max_age_s, 0.5e-6 * config.guard.unheard_us)
        self._extrapolate_us = max(config.neighbour.extrapolate_us, config.guard.flown_on_us)
        # Largest distance (m) of a silent vehicle from its extrapolation at constant velocity.
        self._acceleration_drift = config.limits.a_total * float(
            further(np.array(1e-6 * config.guard.flown_on_us))
        )
        self._stale = config.guard.plan_stale_us
        self._closing = 2.0 * self._max_speed
        field, band = config.field, config.tangential
        self._reach_terms = (
            field.d_safe + field.margin(2),
            0.0 if field.braking is None else 0.5 / field.braking,
            0.0 if field.braking is None else field.reaction,
            band.d_band,
            band.reach_s,
            config.approach_angle.reach + FADING,
        )
        self._relevant_distance = _reach(self._closing, *self._reach_terms) + self._closing * self._horizon_s
        self._landing_distance = config.guard.landing_clearance + config.field.margin(2)
        self._use_all = False
        fused = isinstance(config.target_source, FusedSource)
        self._sees = fused and isinstance(config.formation, Perception)
        self._ignored_until: dict[int, int] = {}
        self.now = 0
        self.use(config.methods)

    def use(self, methods: Sequence[MethodName]) -> None:
        """Adapt to the ``methods`` that the planner uses from now on."""
        # The bounds are Euclidean, and with downwash a vehicle high above is nearer than that.
        downwash = self._config.field.downwash > 1.0
        certified = self._config.avoidance == "certified"
        self._use_all = certified or "swivel" in methods or downwash or self._sees
        self._ignored_until.clear()

    def ignores(self, sender: int) -> bool:
        """Return whether position and plan messages of the system ``sender`` need not be decoded now."""
        return self._ignored_until.get(sender, 0) > self.now

    def look(
        self,
        own: State | None,
        ids: Sequence[int],
        states: Array,
        ages: Ages,
        trusted: Callable[[], NDArray[np.bool_]],
    ) -> None:
        """Determine the systems to ignore from ``now`` on.

        ``own``: the own state; ``ids`` (M), ``states`` (M, 6) and ``ages`` (M,), µs: of the others' last
        positions (m) and velocities (m/s), fleet-local ENU. ``trusted`` returns which of them (M,) are
        trusted; it is called only if there is a candidate.
        """
        self._ignored_until.clear()
        if self._use_all or own is None or own.age > self._config.guard.own_stale_us or not len(states):
            return
        if float(np.sqrt(own.velocity @ own.velocity)) > self._max_speed:
            return
        if _all_within(states, own.position, self._relevant_distance):
            return
        distance = norms(states[:, 0:3] - own.position)
        age = 1e-6 * np.maximum(ages, 0)
        moved = self._max_speed * (age + 1e-6 * max(own.age, 0))
        spare = distance - self._relevant_distance - moved - _MAX_PLAN_OFFSET
        ignored_s = np.minimum(spare / self._closing - self._message_gap_s, self._max_age_s - age)
        ignored_s[norms(states[:, 3:6]) > self._max_speed] = 0.0
        ignored = ignored_s > 0.0
        if not ignored.any():
            return
        until = self.now + (1e6 * ignored_s).astype(np.int64)
        for row in np.flatnonzero(ignored & trusted()).tolist():
            self._ignored_until[ids[row]] = int(until[row])

    def near(self, places: Array, states: Array, ages: Ages) -> NDArray[np.bool_]:
        """Return which (M,) of the others can affect a plan that is made now at one of ``places`` (P, 3).

        ``states`` (M, 6) and ``ages`` (M,), µs: the others' last ones. The result contains those within the
        bound with S = P = 0 of one of the places, and those so near horizontally that a vehicle which lands
        at a place might descend onto them.
        """
        if self._use_all:
            return np.ones(len(states), dtype=np.bool_)
        near = np.empty(len(states), dtype=np.bool_)
        _near(
            np.ascontiguousarray(places),
            states,
            ages,
            self._relevant_distance,
            self._landing_distance,
            self._max_speed,
            self._horizon_s,
            self._extrapolate_us,
            self._stale,
            self._acceleration_drift,
            self._reach_terms,
            near,
        )
        return near


def _reach(
    closing: float, d_safe: float, slowing: float, reaction: float, band: float, reach_s: float, least: float
) -> float:
    """Return the distance (m, between centres) within which one vehicle affects the plan of the other.

    ``closing`` (m/s) is their closing speed; ``slowing`` is 1/(2 ``field.braking``), s²/m; ``reaction`` (s)
    is that of the field; ``band`` (m) and ``reach_s`` (s) are those of the tangential band; ``least`` (m) is
    the reach of the approach angles.
    """
    braking = closing * (closing * slowing + reaction)
    return max(d_safe + max(braking, band + reach_s * closing), least)


@kernel(BOOL, array(2), array(1), FLOAT)
def _all_within(states: Array, place: Array, distance: float) -> bool:
    """Return whether all positions of ``states`` (M, 6) are within ``distance`` (m) of ``place`` (3,)."""
    for j in range(len(states)):
        x, y, z = states[j, 0] - place[0], states[j, 1] - place[1], states[j, 2] - place[2]
        if not x * x + y * y + z * z <= distance * distance:
            return False
    return True


_reach_of = part(_reach)


@kernel(
    VOID,
    array(2),
    array(2),
    array(1, INT),
    *[FLOAT] * 4,
    INT,
    INT,
    FLOAT,
    several(6),
    output(1, BOOL),
)
def _near(
    places: Array,
    states: Array,
    ages: Ages,
    certain: float,
    below: float,
    max_speed: float,
    horizon_s: float,
    extrapolate_us: int,
    stale: int,
    acceleration_drift: float,
    terms: tuple[float, float, float, float, float, float],
    near: NDArray[np.bool_],
) -> None:
    """Write ``RelevanceFilter.near`` to ``near`` (M,); others within ``certain`` (m) are near."""
    for j in range(len(states)):
        least, flat = np.inf, np.inf
        for p in range(len(places)):
            x, y, z = states[j, 0] - places[p, 0], states[j, 1] - places[p, 1], states[j, 2] - places[p, 2]
            flat = min(flat, sqrt(x * x + y * y))
            least = min(least, sqrt(x * x + y * y + z * z))
        near[j] = least <= certain
        if near[j]:
            continue
        x, y, z = states[j, 3], states[j, 4], states[j, 5]
        closing = max_speed + max(sqrt(x * x + y * y + z * z), max_speed)
        drift = 1e-6 * min(max(ages[j], 0), extrapolate_us) * (closing - max_speed) + _MAX_PLAN_OFFSET
        if ages[j] > stale:
            drift += acceleration_drift
        reach = _reach_of(closing, *terms)
        near[j] = least <= reach + closing * horizon_s + drift or flat <= below + drift
