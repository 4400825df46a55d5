"""Fallback when planning fails: the old plan for a bounded time, then a brake to a hover.

No plan is held for longer than ``guard.hold_us``.
"""

from __future__ import annotations

from enum import Enum
from math import ceil

import numpy as np

from companion.config import CompanionConfig
from companion.config.planning import LimitsConfig
from companion.values.horizon import Horizon, Motion, roll_out

_MAX_SHIFT = 0.2
"""m: largest shift of the plan's start towards the vehicle in one plan."""
_USUAL_ERROR = 0.3
"""m: usual deviation of autopilots from their set-points; it is not blended out."""


class Holding(Enum):
    """Kind of the horizon that is flown."""

    FRESH = "fresh plan"
    HELD = "held plan"
    BRAKING = "brake and hover"


class Guard:
    """Owner of the horizon that is flown.

    ``held``: number of replans without a new plan; ``failures``: those caused by the solver.
    ``anchored_anew``: number of plans begun outside the tube (with ``guard.blend``: of exits from the tube).
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
        """Time (µs) since which the solver finds no plan; None while it finds plans."""

    def keep(self, limits: LimitsConfig) -> None:
        """Use these ``limits`` for braking from now on."""
        self._config = self._config.model_copy(update={"limits": limits})

    def start(self, now: int, motion: Motion) -> None:
        """Start at the state ``motion`` at ``now`` (µs): brake from it to a hover until the first plan."""
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
        """Keep the old plan for ``guard.hold_us``, then brake from its state at ``now`` (µs).

        ``solver``: whether a failure of the solver is the reason.
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

    def anchor(self, now: int, measured: Motion) -> Motion:
        """Return the state at ``now`` (µs) to plan from: the flown horizon's, or the ``measured`` one.

        Planning from the flown horizon keeps the set-point continuous and lets the autopilot reject wind. The
        measured state is returned without a horizon, and outside the tube around it. With ``guard.blend`` the
        horizon's state is instead moved towards the vehicle: inside the tube at that rate and only by what
        exceeds 0.3 m, outside the tube by up to 0.2 m per plan.
        """
        last, self._anchored_at = self._anchored_at, now
        if self.horizon is None:
            return measured
        reference = self.horizon.at(now)
        off = measured.position - reference.position
        size = float(np.sqrt(off @ off))
        lost, self._lost = self._lost, size > self._config.guard.tube
        blend = self._config.guard.blend
        if blend is None:
            self.anchored_anew += self._lost
            return measured if self._lost else reference
        self.anchored_anew += self._lost and not lost
        if self._lost:
            share = min(_MAX_SHIFT / size, 1.0)
        else:
            shift = min(blend * max(size - _USUAL_ERROR, 0.0) * (now - last) * 1e-6, _MAX_SHIFT)
            share = shift / max(size, _USUAL_ERROR)
        return Motion(
            reference.position + share * off,
            reference.velocity + share * (measured.velocity - reference.velocity),
            reference.acceleration,
        )


def brake(now: int, motion: Motion, config: CompanionConfig) -> Horizon:
    """Return a horizon that brakes in a straight line to rest within the horizon's length, then hovers.

    It has N + 1 segments. The deceleration is the smallest bound of u, or more where that does not suffice.
    Where even a_total does not stop the vehicle in time, the steps are made longer, because a brake has as
    many steps as a plan. On an axis on which this would go through a wall of the box, the vehicle decelerates
    as much as it takes to stop before it, with a_total at most.
    """
    n, limits = config.horizon.steps + 1, config.limits
    speed = float(np.sqrt(motion.velocity @ motion.velocity))
    dt = max(config.horizon.dt_us, 4 * ceil(speed * 250_000 / ((n - 1) * limits.a_total)))
    h = dt * 1e-6
    rate = max(min(limits.weakest), speed / ((n - 1) * h))
    speeds = np.maximum(0.0, speed - rate * h * np.arange(n + 1))
    direction = motion.velocity / speed if speed > 1e-9 else np.zeros(3)
    accelerations = np.diff(speeds)[:, None] / h * direction
    straight = roll_out(now, dt, motion.position, motion.velocity, accelerations)
    box = limits.within(config.field.margin(1))
    low, high = np.array(box.box_min), np.array(box.box_max)
    end = straight.knots[-1, 0:3]
    through = ((end < low) & (motion.velocity < 0.0)) | ((end > high) & (motion.velocity > 0.0))
    if not through.any():
        return straight
    rates = rate * np.abs(direction)
    room = np.where(motion.velocity < 0.0, motion.position - low, high - motion.position)
    room = np.maximum(room - 0.5 * h * np.abs(motion.velocity), 1e-6)
    left = limits.a_total**2 - float(rates[~through] @ rates[~through])
    most = np.sqrt(max(left, 0.0) / np.count_nonzero(through))
    needed = np.minimum(motion.velocity**2 / (2.0 * room), most)
    rates = np.where(through, np.maximum(rates, needed), rates)
    pressed = float(np.linalg.norm(rates[through]))
    if pressed * pressed > left:
        rates = np.where(through, rates * (np.sqrt(max(left, 0.0)) / pressed), rates)
    each = np.maximum(0.0, np.abs(motion.velocity) - rates * h * np.arange(n + 1)[:, None])
    accelerations = np.diff(each, axis=0) / h * np.sign(motion.velocity)
    return roll_out(now, dt, motion.position, motion.velocity, accelerations)
