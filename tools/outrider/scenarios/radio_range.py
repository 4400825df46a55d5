"""Scenarios with a limited range: what radios must reach so that its proof holds (docs/certified.md)."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, hypot

from companion.avoidance.certified.margins import fastest, margin, sideways
from companion.avoidance.certified.plan_sides import plan_sides
from companion.config import CompanionConfig
from companion.errors import CompanionError
from outrider.scenarios.companion_settings import settings_of
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.starts import places


def against_range(scenario: Scenario) -> Iterator[str]:
    """Yield what a scenario has that committed plans with a limited range do not allow."""
    settings, radio = settings_of(scenario), scenario.links.swarm.range
    if settings.certified.range is None or settings.avoidance != "certified":
        return
    try:
        plan_sides(settings)
    except CompanionError as error:
        yield f"companion.{error}"
    least = _least(scenario, settings, settings.certified.range)
    if radio is not None and radio <= least:
        yield (
            f"links.swarm.range is {radio:g} m: too little for vehicles that are companion.certified.range = "
            f"{settings.certified.range:g} m apart horizontally, or that leave it; allowed with these "
            f"heights, margin, v_max and epoch_us: more than {ceil(1e3 * least) / 1e3:.3f} m, or null"
        )


def _least(scenario: Scenario, settings: CompanionConfig, reach: float) -> float:
    """Return how far (m) radios must reach, at the heights of this scenario.

    Two vehicles within ``reach`` hear each other, also if one of them is on the ground. A vehicle that leaves
    is heard beyond ``reach``: otherwise it would be counted for ever. The true height of each vehicle differs
    from the height of its plan by up to a margin.
    """
    certified, limits = settings.certified, settings.limits
    parted = 2e-6 * fastest(limits) * certified.epoch_us
    leaves = reach + 2.0 * sideways(certified, settings.field, limits) + parted
    if settings.planar:
        starts = places(scenario)[0][:, 2]
        low, high = float(starts.min()), float(starts.max())
    else:
        low, high = limits.box_min[2], limits.box_max[2]
    heights = 2.0 * margin(certified, settings.field, limits)
    apart = high - (low if scenario.airborne else 0.0)
    return max(hypot(leaves, apart + heights), hypot(reach, high + heights))
