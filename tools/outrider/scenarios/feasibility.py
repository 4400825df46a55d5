"""Check for scenarios that cannot work: what no companion could fly is refused before the flight."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from math import pi

import numpy as np

from outrider.scenarios.part import FIRST_SYSTEM
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.starts import Array, places

_DENSEST = pi / 18.0**0.5
"""Largest share of a volume that equal balls fill, 0.74."""


def obstacles_to(scenario: Scenario, span: float) -> Iterator[str]:
    """Yield a sentence for each reason why the vehicles, ``span`` (m) from tip to tip, cannot fly it.

    They are: starts or goals nearer to each other than vehicles are wide, starts or goals outside the box
    of the plans, and a box too small for all vehicles.
    """
    starts, goals = places(scenario)
    for name, found in (("start", starts), ("have goals", goals)):
        if found is not None:
            yield from _too_near(name, found, span)
    yield from _outside("starts", starts[: scenario.vehicles], scenario)
    if goals is not None:
        yield from _outside("has its goal", goals, scenario)
    limits = scenario.companion.limits
    size = np.array(limits.box_max) - np.array(limits.box_min)
    # Centres keep d_min from each other; a ball of that diameter may stand out of the box by half of it.
    room = float(np.prod(size + scenario.d_min))
    crowded = scenario.vehicles * pi / 6.0 * scenario.d_min**3 > _DENSEST * room
    if crowded or (scenario.vehicles > 1 and float(np.linalg.norm(size)) < scenario.d_min):
        sides = " × ".join(f"{side:g}" for side in size)
        yield (
            f"companion.limits: the box of {sides} m has no room for {scenario.vehicles} vehicles that keep"
            f" d_min = {scenario.d_min:g} m; allowed: a larger box"
        )


def _too_near(what: str, found: Array, span: float) -> Iterator[str]:
    for (j, one), (k, other) in combinations(enumerate(found), 2):
        apart = float(np.linalg.norm(one - other))
        if apart < span:
            yield (
                f"vehicles {FIRST_SYSTEM + j} and {FIRST_SYSTEM + k} {what} {apart:.2f} m from each other;"
                f" allowed: at least the {span:.2f} m that they are wide"
            )
            return


def _outside(what: str, found: Array, scenario: Scenario) -> Iterator[str]:
    limits = scenario.companion.limits
    for k, place in enumerate(found):
        for axis, value, low, high in zip(
            ("east", "north", "up"), place, limits.box_min, limits.box_max, strict=True
        ):
            if not low <= value <= high:
                yield (
                    f"vehicle {FIRST_SYSTEM + k} {what} {value:g} m {axis}, outside companion.limits;"
                    f" allowed: {low:g} to {high:g} m {axis}"
                )
                return
