"""What flies when planning does not: the held plan for a bounded time, then a brake to hover. Nothing is held
for ever."""

from __future__ import annotations

from enum import Enum
from math import ceil

import numpy as np

from companion.config import CompanionConfig
from companion.config.planning import LimitsConfig
from companion.values.horizon import Horizon, Motion, roll_out

_STEP = 0.2
"""m: no set-point is moved by more at once."""
_BESIDE = 0.3
"""m: autopilots are so far beside their set-points all the time."""


class Holding(Enum):
    """What the vehicle is flying, and why."""

    FRESH = "fresh plan"
    HELD = "held plan"
    BRAKING = "brake and hover"


class Guard:
    """Owns the horizon that is flown. ``held`` counts replans that kept the old one, ``failures`` those by
    the solver."""

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
        """Since when (µs) the solver finds no plan; None while it does."""

    def keep(self, limits: LimitsConfig) -> None:
        """Brake within other ``limits`` from now on."""
        self._config = self._config.model_copy(update={"limits": limits})

    def start(self, now: int, motion: Motion) -> None:
        """Fly from this state on: a hover there until the first plan."""
        self.failing = None
        self.horizon = brake(now, motion, self._config)
        self._fresh_at = now
        self.state = Holding.FRESH

    def rest(self) -> None:
        """Nothing is flown, for nothing is steered: what failed then is over."""
        self.failing = self.horizon = None

    def accept(self, now: int, horizon: Horizon) -> None:
        """A good plan."""
        self.failing = None
        self.horizon = horizon
        self._fresh_at = now
        self.state = Holding.FRESH

    def hold(self, now: int, *, solver: bool) -> None:
        """No good plan: keep the old one while it is young enough, then brake from where it has got to."""
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
        """The state to plan from: the flown horizon's, unless the vehicle has left the tube around it.

        Planning from the plan keeps the set-point continuous and lets the autopilot reject wind; out of the
        tube the plan starts anew at the measured state. With ``guard.blend`` it is brought nearer to the
        vehicle all the time, so slowly that no set-point jumps; out of the tube faster, but no step is longer
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
    """Straight to rest within the horizon, at u_max or as hard as that takes; then hover. (N + 1 segments.)

    Where even a_total does not stop the vehicle in time the steps get longer: a brake has as many as a plan.
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
