"""Fallback when planning fails: the old plan for a bounded time, then a brake to a hover.

No plan is kept indefinitely.
"""

from __future__ import annotations

from enum import Enum
from math import ceil

import numpy as np

from companion.config import CompanionConfig
from companion.config.planning import LimitsConfig
from companion.values.horizon import Horizon, Motion, roll_out

_STEP = 0.2
"""m: largest displacement of a set-point in one step."""
_BESIDE = 0.3
"""m: usual deviation of autopilots from their set-points."""


class Holding(Enum):
    """What the vehicle flies at present."""

    FRESH = "fresh plan"
    HELD = "held plan"
    BRAKING = "brake and hover"


class Guard:
    """Owner of the horizon that is flown.

    ``held``: number of replans that kept the old horizon; ``failures``: those of them that were caused by the
    solver.
    """

    def __init__(self, config: CompanionConfig) -> None:
        self._config = config
        self._fresh_at = 0
        self.horizon: Horizon | None = None
        self.state = Holding.FRESH
        self.held = 0
        self.failures = 0
        self.anchored_anew = 0
        self._lost = False
        self._anchored_at = 0
        self.failing: int | None = None
        """Time (µs) since which the solver finds no plan; None while it does."""

    def keep(self, limits: LimitsConfig) -> None:
        """Use these ``limits`` for braking from now on."""
        self._config = self._config.model_copy(update={"limits": limits})

    def start(self, now: int, motion: Motion) -> None:
        """Start at this state at ``now`` (µs): brake to a hover there until the first plan."""
        self.failing = None
        self.horizon = brake(now, motion, self._config)
        self._fresh_at = now
        self.state = Holding.FRESH

    def rest(self) -> None:
        """Clear the flown horizon and the solver's failure, because set-points do not steer the vehicle."""
        self.failing = self.horizon = None

    def accept(self, now: int, horizon: Horizon) -> None:
        """Accept a new plan at ``now`` (µs)."""
        self.failing = None
        self.horizon = horizon
        self._fresh_at = now
        self.state = Holding.FRESH

    def hold(self, now: int, *, solver: bool) -> None:
        """Keep the old plan while it is young enough, then brake from its state at ``now`` (µs).

        ``solver``: whether the solver is the reason that there is no new plan.
        """
        self.held += 1
        self.failures += solver
        if solver and self.failing is None:
            self.failing = now
        if self.horizon is None or self.state is Holding.BRAKING:
            return
        self.state = Holding.HELD
        if now - self._fresh_at > self._config.guard.hold_us:
            self.horizon = brake(now, self.horizon.at(now), self._config)
            self.state = Holding.BRAKING

    def anchor(self, now: int, position: Motion) -> Motion:
        """Return the state to plan from.

        It is the flown horizon's, unless the vehicle is outside the tube around it.

        Planning from the plan keeps the set-point continuous and lets the autopilot reject wind; outside the
        tube the plan restarts at the measured state. With ``guard.blend`` the state is moved continuously
        towards the vehicle, so slowly that no set-point jumps; outside the tube faster, but no step is longer
        than 0.2 m.
        """
        last, self._anchored_at = self._anchored_at, now
        if self.horizon is None:
            return position
        reference = self.horizon.at(now)
        off = position.position - reference.position
        size = float(np.sqrt(off @ off))
        lost, self._lost = self._lost, size > self._config.guard.tube
        blend = self._config.guard.blend
        if blend is None:
            self.anchored_anew += self._lost
            return position if self._lost else reference
        self.anchored_anew += self._lost and not lost
        if self._lost:
            share = min(_STEP / size, 1.0)
        else:
            share = min(blend * max(size - _BESIDE, 0.0) * (now - last) * 1e-6, _STEP) / max(size, _BESIDE)
        return Motion(
            reference.position + share * off,
            reference.velocity + share * (position.velocity - reference.velocity),
            reference.acceleration,
        )


def brake(now: int, motion: Motion, config: CompanionConfig) -> Horizon:
    """Return a horizon that brakes in a straight line to rest within the horizon's length, then hovers.

    It has N + 1 segments. The deceleration is the smallest of u_max, or more where that does not suffice.
    Where even a_total does not stop the vehicle in time the steps get longer, because a brake has as many
    steps as a plan.
    """
    n, limits = config.horizon.steps + 1, config.limits
    speed = float(np.sqrt(motion.velocity @ motion.velocity))
    dt = max(config.horizon.dt_us, 4 * ceil(speed * 250_000 / ((n - 1) * limits.a_total)))
    h = dt * 1e-6
    rate = max(min(limits.u_max), speed / ((n - 1) * h))
    speeds = np.maximum(0.0, speed - rate * h * np.arange(n + 1))
    direction = motion.velocity / speed if speed > 1e-9 else np.zeros(3)
    accelerations = np.diff(speeds)[:, None] / h * direction
    return roll_out(now, dt, motion.position, motion.velocity, accelerations)
