"""Settings that a scenario adds to the configuration of its companions."""

from __future__ import annotations

from companion.config import CompanionConfig
from outrider.scenarios.scenario import Scenario
from sitl.estimation.profiles import PROFILES


def settings_of(scenario: Scenario) -> CompanionConfig:
    """Return the companions' settings, completed from the scenario.

    They include the scenario's obstacles; ``field.position_sigma``, at least that of the sensor profile; and,
    with certified avoidance, the ids of the vehicles without bystanders as ``certified.fleet`` unless it is
    given.
    """
    companion, profile = scenario.companion, PROFILES[scenario.sensors]
    known = (*companion.obstacles, *scenario.obstacles)
    moving = (*companion.moving, *scenario.moving_known)
    sigma = max(companion.field.position_sigma, profile.worst_axis)
    field = companion.field.model_copy(update={"position_sigma": sigma})
    changes: dict[str, object] = {"obstacles": known, "moving": moving, "field": field}
    if companion.avoidance == "certified" and not companion.certified.fleet:
        fleet = tuple(scenario.systems[: scenario.vehicles])
        changes["certified"] = companion.certified.model_copy(update={"fleet": fleet})
    return companion.model_copy(update=changes)
