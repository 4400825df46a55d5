"""Evidence without a flight: who told what, and everybody heard it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from hypothesis import strategies as st

from companion.avoidance.certified.committed import carried_on, controls, resting
from companion.values.horizon import Array
from mavlink_bridge.wire.plan import Integers, WirePlan
from outrider.certify.evidence import Evidence, FarewellChange, Log, LoggedPlan, Terms

DT = EPOCH = 200_000
"""µs."""
STEPS = 16
BEGAN = 1_767_225_600_000_000
REQUIRED = 1.2
COPIES = 4
"""A plan is told so often."""
TERMS = Terms((11, 12), frozenset(), DT, EPOCH, STEPS, 7, REQUIRED, (2000, 2000, 2000), False)


def standing(place: Sequence[float], epoch: int = BEGAN) -> WirePlan:
    """To stand at ``place`` m."""
    return resting(epoch, DT, STEPS, place, TERMS.origin)


def on(plan: WirePlan, epochs: int = 1) -> WirePlan:
    """The same, carried on."""
    return carried_on(plan, epochs)


def turned(plan: WirePlan, accelerations: Sequence[Integers]) -> WirePlan:
    """From where ``plan`` begins, with these ``accelerations`` (mm/s²), and then to rest."""
    missing = STEPS - 1 - len(accelerations)
    knots = (*accelerations, *((0, 0, 0),) * missing)
    x, y, z = (-v - sum(axis) for v, *axis in zip(plan.velocity, *knots, strict=True))
    return plan._replace(accelerations=(*knots, (x, y, z)))


def evidence(
    sent: Mapping[int, Sequence[WirePlan]],
    terms: Terms = TERMS,
    words: Mapping[int, Sequence[FarewellChange]] | None = None,
) -> Evidence:
    """Every plan of every vehicle is told half an epoch before it begins, and heard by all."""
    said = words or {}
    logs = []
    for owner in sent:
        sightings = [
            LoggedPlan(owner, sender, plan, plan.epoch - EPOCH // 2, COPIES)
            for sender, plans in sent.items()
            for plan in plans
        ]
        logs.append(Log(owner, tuple(sightings), (), tuple(said.get(owner, ())), 0))
    return Evidence(terms._replace(fleet=tuple(sent)), tuple(logs))


def least_of_samples(one: WirePlan, other: WirePlan, count: int = 41) -> float:
    """Least distance (m) of two plans of one epoch, looked at ``count`` times on each segment."""
    s = np.linspace(0.0, 1.0, count)
    weights = np.stack([(1.0 - s) ** 2, 2.0 * s * (1.0 - s), s**2], axis=1)
    apart: Array = weights @ (controls(one) - controls(other))
    return float(np.linalg.norm(apart, axis=-1).min())


def hull_excess(one: WirePlan, other: WirePlan) -> float:
    """How far (m) a hull of control points may reach beyond its curve: |a| dt²/4 of the relative motion."""
    relative = one.accelerations_m_s2 - other.accelerations_m_s2
    return float(np.linalg.norm(relative, axis=1).max()) * (1e-6 * DT) ** 2 / 4


_axis = st.integers(-1000, 1000)
accelerations = st.lists(st.tuples(_axis, _axis, _axis), min_size=1, max_size=STEPS - 1)
places = st.tuples(*[st.floats(-2.0, 2.0)] * 3)
