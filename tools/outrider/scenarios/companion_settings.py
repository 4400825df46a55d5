"""Settings that a scenario adds to the configuration of its companions."""

from __future__ import annotations

from math import degrees, hypot

from companion.config import CompanionConfig
from companion.config.target_source import FusedSource, OwnErrors
from outrider.scenarios.scenario import Scenario
from sitl.estimation.profiles import PROFILES, SensorProfile

_MESSAGE_ERROR_M = 0.0045
"""σ (m) of a detection by what messages leave of its place: 0.32 cm of a step of 1.1 cm (degE7), twice."""


def settings_of(scenario: Scenario) -> CompanionConfig:
    """Return the companions' settings, completed from the scenario.

    They include the scenario's obstacles; the errors of the vehicles' own estimates for the fusion of
    detections, unless they are given; ``field.position_sigma``, at least that of the sensor profile; and,
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
    source = companion.target_source
    if isinstance(source, FusedSource) and source.own_errors is None:
        changes["target_source"] = source.model_copy(update={"own_errors": own_errors(profile, scenario)})
    return companion.model_copy(update=changes)


def own_errors(profile: SensorProfile, scenario: Scenario | None = None) -> OwnErrors:
    """Return the errors of a vehicle's own estimate with the sensors of ``profile``.

    Those of roll and pitch are not in the detections of the ``scenario`` if gimbals stabilise all cameras.
    """
    cameras = [] if scenario is None else [scenario.camera, *(one.camera for one in scenario.cameras)]
    mounts = {one.mount.kind for one in cameras if one is not None}
    return OwnErrors(
        sigma_horizontal=profile.horizontal_drift,
        sigma_vertical=profile.vertical_drift,
        position_s=profile.drift_time,
        sigma_yaw_deg=degrees(profile.yaw),
        yaw_s=profile.yaw_time,
        sigma_tilt_deg=0.0 if mounts == {"gimbal"} else degrees(profile.tilt),
        tilt_s=profile.tilt_time,
        sigma_white=hypot(profile.position_white, _MESSAGE_ERROR_M),
        age_us=profile.delay,
    )
