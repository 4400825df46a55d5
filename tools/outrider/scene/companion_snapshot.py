"""Snapshot of a companion, without a change of its state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from companion.flight.guard import Holding
from companion.node import Companion
from companion.values.phase import Phase
from outrider.scene.snapshot import NO_PLAN, Single, State, padded

_HELD = {Holding.HELD: ", old plan", Holding.BRAKING: ", braking"}
MODES = tuple(phase.value + held for phase in Phase for held in ("", *_HELD.values()))
"""All possible modes of a companion, in words."""


class CompanionSnapshot(NamedTuple):
    """State of a companion, and the plan (KNOTS, 6) that it flies."""

    state: State
    plan: Single


def companion_snapshot(companion: Companion, now: int) -> CompanionSnapshot:
    """Return the snapshot of ``companion`` at ``now`` (µs)."""
    horizon, phase = companion.flown, companion.pilot.phase
    ages = companion.world.neighbours.ages(now)
    mode = phase.value + (_HELD.get(companion.avoidance.state, "") if phase is Phase.ESCORT else "")
    state = State(
        mode,
        1e-6 * max(max(ages.values()), 0) if ages else np.nan,
        np.nan if companion.last_spent is None else 1e-6 * companion.last_spent,
        companion.avoidance.held,
    )
    return CompanionSnapshot(state, NO_PLAN if horizon is None else padded(horizon.knots[:, :6]))
