"""Stages of a plan: the time of each, by timers around the functions that make them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from companion.avoidance.certified import commitment, qp
from companion.avoidance.certified.constraint_sources import ConstraintSources
from companion.avoidance.certified.qp import SeparationQp
from companion.avoidance.field import planner
from companion.avoidance.field.dqmpc import Dqmpc
from companion.avoidance.field.methods.tangential import Tangential
from companion.goals.heading import Heading
from companion.obstacles.neighbours import Neighbours
from outrider.bench import certified, field

_ROUNDS = 3
"""Rounds after the first, in which what has been received is new and everything runs for the first time."""
Stage = tuple[Any, str]
"""Owner and name of a function."""

FIELD: Mapping[str, Stage] = {
    "neighbours aligned": (Neighbours, "obstacles"),
    "field": (planner, "repulsion"),
    "tangential band": (Tangential, "influence"),
    "limit and smoothing": (planner, "smoothed"),
    "QP vectors": (Dqmpc, "problem"),
    "QPs": (Dqmpc, "solve"),
    "roll-out": (planner, "roll_out"),
    "gradient": (Dqmpc, "gradient"),
    "yaw": (Heading, "plan"),
    "set-point": (field, "setpoint"),
}
CERTIFIED: Mapping[str, Stage] = {
    "constraint sources": (ConstraintSources, "around"),
    "planes": (commitment, "planes"),
    "QP": (SeparationQp, "solve"),
    "rows": (qp, "rows_within"),
    "binding rows": (qp, "active_set"),
    "PIQP": (SeparationQp, "_multipliers"),
    "rounding": (commitment, "committed_with_controls"),
    "yaw": (Heading, "plan"),
    "set-point": (certified, "setpoint"),
}


def measured() -> dict[str, dict[str, float]]:
    """Return the median time (µs of wall time) of each stage of a field plan and of a certified plan.

    A stage that calls another one includes it, as ``QP`` includes ``rows``, ``binding rows`` and ``PIQP``.
    """
    found = {}
    for mode, of, run in (("field", FIELD, field.plan_step), ("certified", CERTIFIED, certified.plan_step)):
        with timed(of) as times:
            run(_ROUNDS)
        found[mode] = {name: _median_us(spent) for name, spent in times.items() if spent}
    return found


def _median_us(spent: list[int]) -> float:
    return round(1e-3 * float(np.median(spent)), 1)


@contextmanager
def timed(of: Mapping[str, Stage]) -> Iterator[dict[str, list[int]]]:
    """Put timers around the functions of the stages; yield the times (ns) of their calls, by stage."""
    times: dict[str, list[int]] = {name: [] for name in of}
    originals = {name: getattr(*stage) for name, stage in of.items()}

    def timer(name: str) -> Any:
        function, spent = originals[name], times[name]

        def call(*args: Any, **kwargs: Any) -> Any:
            started = time.perf_counter_ns()
            try:
                return function(*args, **kwargs)
            finally:
                spent.append(time.perf_counter_ns() - started)

        return call

    try:
        for name, (owner, attribute) in of.items():
            setattr(owner, attribute, timer(name))
        yield times
    finally:
        for name, (owner, attribute) in of.items():
            setattr(owner, attribute, originals[name])
