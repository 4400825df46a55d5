"""Feed-forward of a committed plan: what set-points add to it so that the vehicle is where the plan says.

An autopilot follows set-points with a lag τ of the attitude, and its integral replaces the acceleration κ v
that drag takes only after seconds. A committed plan is known ahead, so both are added before they are missed:
a vehicle on its plan with the acceleration a(t) needs the command

    a(t) + R(t),   R(t) = (1 + D) a(t + τ) − a(t) + κ v(t + τ),

where D is the gain of the velocity loop's derivative of the measured velocity (PX4). PX4 takes R as an
addition to the acceleration of the set-point; its κ v is ``Tracking.compensation``, with all of κ.

ArduPilot does not follow set-points, but a trajectory of bounded jerk that approaches them: it takes an
addition to the acceleration for an error, and removes it in half a second. It lets pass only what is
consistent. So the trajectory is moved aside by δ, for which the loop itself commands R:

    δ̈ = R − k_v y − k_i ∫y,   y = δ̇ + k_p δ,

with min(κ, ``LARGEST_DRAG``) in place of κ in R, and the gains of the position loop (k_p, k_v) and of its
integral (k_i). δ fades where the speed is constant. The position of the set-point stays on the plan: the
addition δ̇ + g δ to the velocity and δ̈ to the acceleration move the trajectory by δ, with the gain g of its
approach to the position.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from companion.flight.autopilots import Inverse, Loop
from companion.values.horizon import Array, Motion

USUAL_DRAG = 0.25
"""1/s: drag per speed of a multirotor before it is estimated; most have 0.15 to 0.4."""
LARGEST_DRAG = 0.5
"""1/s: largest drag per speed for which δ is computed.

A late response looks like drag while a vehicle accelerates. With the drag that was estimated then (up to 2
1/s) δ grew, so that the trajectory fell behind further: with 0.13 s of delay a vehicle flew 1.4 m past its
plan. More drag than this is left to the integral of the autopilot.
"""
_PERIOD_US = 20_000
"""Longest step (µs) in which δ is advanced."""
MAX_PAUSE_US = 500_000
"""µs between two set-points; after a longer pause δ begins anew at zero."""
MAX_OFFSET_M = 0.5
"""m: largest δ on each axis; for the plans of the shipped files it is 0.3 m."""
NOTHING: Array = np.zeros(3)
"""No addition."""
NOTHING.flags.writeable = False


class Additions(NamedTuple):
    """Additions to set-points: ``velocity`` (3,), m/s, and ``acceleration`` (3,), m/s², fleet-local ENU.

    ``offset`` (3,), m: δ, by which the trajectory of the autopilot is aside of the plan; ``offset_velocity``
    (3,), m/s: δ̇.
    """

    velocity: Array = NOTHING
    acceleration: Array = NOTHING
    offset: Array = NOTHING
    offset_velocity: Array = NOTHING


class PlanFeedforward:
    """Feed-forward of one vehicle; only horizontal."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin anew: no offset."""
        self._last: int | None = None
        # Rows: δ, δ̇, ∫y and the last δ̈.
        self._state: Array = np.zeros((4, 2))

    def step(self, now: int, plan: Callable[[int], Motion], loop: Loop, drag: float) -> Additions:
        """Return the additions to the set-point at ``now`` (µs); call this for each set-point.

        ``plan`` gives the planned motion at a time (µs), ``drag`` is κ (1/s); δ is computed with
        min(κ, ``LARGEST_DRAG``).
        """
        inverse = loop.inverse
        if inverse is None:
            return Additions(acceleration=_level(loop.derivative * plan(now + loop.lead_us).acceleration[:2]))
        if self._last is None or not 0 <= now - self._last <= MAX_PAUSE_US:
            self.reset()
            self._last = now
            self._advance(now, 0, plan, loop, inverse, drag)
        while self._last < now:
            self._advance(self._last, min(_PERIOD_US, now - self._last), plan, loop, inverse, drag)
        offset, speed, _, change = self._state
        approach = 0.0 if loop.shaping is None else loop.shaping.position
        added = speed + approach * offset
        return Additions(_level(added), _level(change), _level(offset), _level(speed))

    def _advance(
        self, time: int, step: int, plan: Callable[[int], Motion], loop: Loop, inverse: Inverse, drag: float
    ) -> None:
        """Advance δ from ``time`` by ``step`` (µs)."""
        self._last, dt = time + step, 1e-6 * step
        here, later = plan(self._last), plan(self._last + inverse.lag_us)
        needed = (later.acceleration - here.acceleration + min(drag, LARGEST_DRAG) * later.velocity)[:2]
        offset, speed, total, change = self._state
        moved = offset + dt * (speed + 0.5 * dt * change)
        offset = np.minimum(np.maximum(moved, -MAX_OFFSET_M), MAX_OFFSET_M)
        speed = np.where(moved == offset, speed + dt * change, 0.0)
        closing = speed + loop.position * offset
        total = total + dt * closing
        change = needed - loop.velocity * closing - inverse.integral * total
        self._state = np.stack([offset, speed, total, change])


def _level(horizontal: Array) -> Array:
    """Return ``horizontal`` (2,) with a zero as third component."""
    return np.append(horizontal, 0.0)
