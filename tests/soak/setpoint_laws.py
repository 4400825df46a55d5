"""What holds for every set-point that leaves a companion: finite, within limits, near the vehicle, without
jumps, and only while the vehicle is ours."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from companion.estimation.tracks import State
from companion.values.phase import Phase
from mavlink_bridge.messages import SetpointLocal
from tests.companion.bench import field_of
from tests.soak.airfield import CONFIG, Craft

_SINGLE = 1e-4
_CORRECTED = 0.3
"""m by which a set-point may step where the plan begins anew at the measured state."""


class Sent(NamedTuple):
    """A set-point at ``now`` to the place ``here`` (3,) m, fleet-local ENU, in the plan of ``anchor``."""

    now: int
    here: np.ndarray
    anchor: tuple[int, object]
    message: SetpointLocal


class SetpointLaws:
    """``must`` is told of each law whether it holds. ``last`` of each vehicle, and how many were ``sent``."""

    def __init__(self, must: Callable[[Craft, bool, str], None]) -> None:
        self._must = must
        self.last: dict[int, Sent] = {}
        self.sent: Counter[int] = Counter()

    def take(self, craft: Craft, now: int, message: SetpointLocal) -> None:
        """One of ``craft``."""
        system, limits = craft.system, CONFIG.limits
        pilot = craft.companion.pilot
        self.sent[system] += 1
        self._must(craft, pilot.vehicle.alive and pilot.streaming, "no set-point but to who follows them")
        self._must(craft, pilot.phase is not Phase.YIELDED, "nothing for who was taken over")
        numbers = (*message.position, *message.velocity, *message.acceleration, message.yaw, message.yaw_rate)
        self._must(craft, all(map(math.isfinite, numbers)), f"finite: {message}")
        most = limits.a_total + _SINGLE
        self._must(craft, math.hypot(*message.acceleration) <= most, f"a_total: {message}")
        # A limit of the state gives way to those of the acceleration: what pushes may be stronger than u_max.
        fastest = math.hypot(*limits.v_max)
        self._must(craft, math.hypot(*message.velocity) <= fastest + _SINGLE, f"v_max: {message}")
        view = craft.companion.world.at(now)
        self._must(craft, view.own is not None and view.local is not None, "no set-point without a place")
        assert view.own is not None
        assert view.local is not None
        here = view.local.position_to_fleet(message.position)
        if view.own.age <= 100_000 and not self._has_jumped(craft, now, view.own):
            off = float(np.linalg.norm(here - view.own.position))
            self._must(craft, off <= CONFIG.guard.tube + 0.5, f"{off:.2f} m from the vehicle: {message}")
        before, anchor = self.last.get(system), (field_of(craft.companion).guard.anchored_anew, view.local)
        if before is not None and now - before.now <= 100_000 and before.anchor == anchor:
            step, dt = float(np.linalg.norm(here - before.here)), 1e-6 * (now - before.now)
            self._must(craft, step <= fastest * dt + _CORRECTED, f"a jump of {step:.2f} m: {message}")
        self.last[system] = Sent(now, here, anchor, message)

    def _has_jumped(self, craft: Craft, now: int, own: State) -> bool:
        """Whether it was believed elsewhere when the plan was made: an estimate jumps when GPS is back."""
        then, place, jumped = craft.marks.get("believed", (now, own.position, 0))
        reach = 1.0 + 1e-6 * (now - then) * math.hypot(*CONFIG.limits.v_max)
        if float(np.linalg.norm(own.position - place)) > reach:
            jumped = now
        craft.marks["believed"] = now, own.position, jumped
        return now - jumped <= 2 * CONFIG.rates.replan_us
