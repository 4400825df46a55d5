"""Whom not to listen to for a moment: who is so far off that nothing it may say meanwhile could matter.

The bound. A vehicle acts on a plan where, at some time within the horizon H, it is nearer than ``reach``:
what the field, the band and the angles reach when closing at c, the sum of both speeds. Neither is faster
than the norm of ``limits.v_max``, or than it is measured to be. A neighbour whose last state is ``age`` old,
at a distance d from here, is nearer by c·(S + P + H) and its own speed times ``age`` at most when plans that
are made until S from now, and for P after that, end. So it is ignored for no longer than

    S = (d − reach(c) − v·age) / c − P − H

P are two periods of messages like our own: one may be lost, and still it is heard in time. Nobody is ignored
for longer than ``_LONGEST`` after it was heard: ages that are shown stay those of a neighbour that is there.

Only those are ignored whose word counts (``familiars``) and who were not measured to be faster than the
limits, and nobody where the own place is not known. Who is level with the own place in the plane is laid
before the planner from any height, as landing is straight down. The certified mode hears and sees all, since
there what somebody promised counts, not where it is; so does the swivel, which weighs all bearings.
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
"""µs of age; an autopilot is taken for its vehicle's only voice after a second without its companion's."""
_OFF_PLAN = 1.0
"""m by which a plan that counts may begin beside its sender's track."""


class RelevanceFilter:
    """Of one companion. All times µs on its clock; ``now`` has to be set before headers are asked about."""

    def __init__(self, config: CompanionConfig) -> None:
        self._config = config
        self._fastest = hypot(*config.limits.v_max)
        self._ahead = 1e-6 * config.horizon.dt_us * (config.horizon.steps + 1)
        self._silence = 2e-6 * max(config.rates.state_us, config.rates.plan_us)
        self._longest = 1e-6 * min(
            _LONGEST, config.neighbour.extrapolate_us, config.guard.neighbour_lost_us // 4
        )
        self._shown = max(config.neighbour.extrapolate_us, config.guard.flown_on_us)
        # By so much (m) may who has fallen silent have been driven off its course.
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
        """The planner goes by these ``methods`` now."""
        self._all = self._config.avoidance == "certified" or "swivel" in methods
        self._until.clear()

    def ignores(self, sender: int) -> bool:
        """Whether what this system says of where it is and will be need not be decoded now."""
        return self._until.get(sender, 0) > self.now

    def look(
        self,
        own: State | None,
        ids: Sequence[int],
        states: Array,
        ages: Ages,
        familiar: Callable[[], NDArray[np.bool_]],
    ) -> None:
        """Find out whom to ignore from ``now`` on. ``states`` (M, 6) are the others' last positions and
        velocities, fleet-local ENU, ``ages`` (M,) µs. ``familiar`` is asked whose word counts (M,), if there
        is anybody to be ignored."""
        self._until.clear()
        if self._all or own is None or own.age > self._config.guard.own_stale_us or not len(states):
            return
        if float(np.sqrt(own.velocity @ own.velocity)) > self._fastest:
            return
        apart = norms(states[:, 0:3] - own.position)
        if apart.max() <= self._certainly:
            return
        age = 1e-6 * np.maximum(ages, 0)
        # What is known of the own place may be old as well.
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
        """Which (M,) of the others can act on a plan that is made at one of ``places`` (P, 3) now: all whose
        states (M, 6) of ``ages`` (M,) µs are within the bound for S = P = 0 of one, and whom a vehicle that
        lands there would come down on."""
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
        """How near (m, between centres) two have to come before one acts on the other when they close at
        ``closing`` m/s."""
        config = self._config
        field, band = config.field, config.tangential
        braking = np.zeros_like(closing)
        if field.braking is not None:
            braking = np.square(closing) / (2.0 * field.braking) + field.reaction * closing
        reach = field.d_safe + field.margin(2) + np.maximum(braking, band.d_band + band.reach_s * closing)
        return np.asarray(np.maximum(reach, config.approach_angle.reach + FADING), dtype=np.float64)
