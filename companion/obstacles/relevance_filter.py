"""Relevance filter: skips messages of neighbours too distant to affect the plan for a while.

The bound: a neighbour affects a vehicle's plan if, at some time within the horizon H, it is nearer than
``reach``: the distance at which the field, the band and the angles act when closing at c, the sum of both
speeds. Neither vehicle is faster than the norm of ``limits.v_max``, or than its measured speed. Consider a
neighbour at a distance d whose last state is ``age`` old, with a speed v. Until the end of the plans that are
made within S + P from now, it approaches by at most c·(S + P + H) + v·``age``. So it is ignored for at most

    S = (d − reach(c) − v·age) / c − P − H

P is two message periods of the own vehicle: one message may be lost, and the next one is still received in
time. No neighbour is ignored for longer than ``_LONGEST`` after its last message: the displayed ages remain
those of a neighbour that is present.

Only trusted peers (``trusted_peers``) that were not measured to be faster than the limits are ignored, and
none while the own position is unknown. Neighbours above or below the own position are passed to the planner
from any height, because vehicles land straight down. The certified mode receives and uses all messages, since
there the commitments of a neighbour count and not its position; so does the swivel method, which uses all
bearings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot

import numpy as np
from numpy.typing import NDArray

from companion.config import CompanionConfig
from companion.config.planning import FADING, MethodName
from companion.estimation.tracks import State
from companion.obstacles.reachable_ball import further, norms
from companion.values.horizon import Array

Ages = NDArray[np.int64]
_LONGEST = 700_000
"""µs of age; after a second without its companion an autopilot counts as its vehicle's only sender."""
_OFF_PLAN = 1.0
"""m by which a trusted plan may begin beside its sender's track."""


class RelevanceFilter:
    """Relevance filter of one companion.

    All times are µs on its clock; ``now`` must be set before headers are checked.
    """

    def __init__(self, config: CompanionConfig) -> None:
        self._config = config
        self._fastest = hypot(*config.limits.v_max)
        self._ahead = 1e-6 * config.horizon.dt_us * (config.horizon.steps + 1)
        self._silence = 2e-6 * max(config.rates.state_us, config.rates.plan_us)
        self._longest = 1e-6 * min(
            _LONGEST, config.neighbour.extrapolate_us, config.guard.neighbour_lost_us // 4
        )
        self._shown = max(config.neighbour.extrapolate_us, config.guard.flown_on_us)
        # Distance (m) by which a silent vehicle may have been accelerated off its course.
        self._driven = config.limits.a_total * float(further(np.array(1e-6 * config.guard.flown_on_us)))
        self._stale = config.guard.plan_stale_us
        self._closing = 2.0 * self._fastest
        self._certainly = float(self._reach(self._closing)) + self._closing * self._ahead
        self._below = config.guard.landing_clearance + config.field.margin(2)
        self._all = False
        self._until: dict[int, int] = {}
        self.now = 0
        self.use(config.methods)

    def use(self, methods: Sequence[MethodName]) -> None:
        """Adapt to the ``methods`` that the planner uses from now on."""
        self._all = self._config.avoidance == "certified" or "swivel" in methods
        self._until.clear()

    def ignores(self, sender: int) -> bool:
        """Return whether position and plan messages of this system need not be decoded now."""
        return self._until.get(sender, 0) > self.now

    def look(
        self,
        own: State | None,
        ids: Sequence[int],
        states: Array,
        ages: Ages,
        familiar: Callable[[], NDArray[np.bool_]],
    ) -> None:
        """Determine the systems to ignore from ``now`` on.

        ``states`` (M, 6) are the others' last positions (m) and velocities (m/s), fleet-local ENU; ``ages``
        (M,) in µs. ``familiar`` returns which of them (M,) are trusted; it is called only if there is a
        candidate.
        """
        self._until.clear()
        if self._all or own is None or own.age > self._config.guard.own_stale_us or not len(states):
            return
        if float(np.sqrt(own.velocity @ own.velocity)) > self._fastest:
            return
        apart = norms(states[:, 0:3] - own.position)
        if apart.max() <= self._certainly:
            return
        age = 1e-6 * np.maximum(ages, 0)
        # The own state may be old as well.
        spare = apart - self._certainly - self._fastest * (age + 1e-6 * max(own.age, 0)) - _OFF_PLAN
        silence = np.minimum(spare / self._closing - self._silence, self._longest - age)
        silence[norms(states[:, 3:6]) > self._fastest] = 0.0
        silent = silence > 0.0
        if not silent.any():
            return
        until = self.now + (1e6 * silence).astype(np.int64)
        for row in np.flatnonzero(silent & familiar()).tolist():
            self._until[ids[row]] = int(until[row])

    def near(self, places: Array, states: Array, ages: Ages) -> NDArray[np.bool_]:
        """Return which (M,) of the others can affect a plan that is made now at one of ``places`` (P, 3).

        These are all whose ``states`` (M, 6) of ``ages`` (M,) µs are within the bound with S = P = 0 of one
        of the places, and those onto which a vehicle that lands there would descend.
        """
        off = states[:, None, 0:3] - places
        apart = norms(off).min(axis=1)
        near: NDArray[np.bool_] = (apart <= self._certainly) | self._all
        if near.all():
            return near
        closing = self._fastest + np.maximum(norms(states[:, 3:6]), self._fastest)
        gone = 1e-6 * np.clip(ages, 0, self._shown) * (closing - self._fastest)
        gone += self._driven * (ages > self._stale)
        near = apart <= self._reach(closing) + closing * self._ahead + gone + _OFF_PLAN
        below = norms(off[:, :, 0:2]).min(axis=1) <= self._below + gone + _OFF_PLAN
        return np.asarray(near | below)

    def _reach(self, closing: Array | float) -> Array:
        """Return the distance (m, between centres) at which two vehicles act on each other.

        ``closing`` (m/s): their closing speed.
        """
        config = self._config
        field, band = config.field, config.tangential
        braking = np.zeros_like(closing)
        if field.braking is not None:
            braking = np.square(closing) / (2.0 * field.braking) + field.reaction * closing
        reach = field.d_safe + field.margin(2) + np.maximum(braking, band.d_band + band.reach_s * closing)
        return np.asarray(np.maximum(reach, config.approach_angle.reach + FADING), dtype=np.float64)
