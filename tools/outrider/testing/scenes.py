"""Scenarios with changes, flown or used to replay a log."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from mavlink_bridge.errors import LogError
from mavlink_bridge.tlog.log import read_tlog
from outrider.errors import InputError
from outrider.resources import find
from outrider.scenarios.scenario import Scenario
from outrider.shadow.roles import Roles, check, survey
from outrider.shadow.shadow_run import shadow_flight
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm
from outrider.testing.flown import Flown, Replayed
from outrider.testing.golden import Golden
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig


def flown(scenario: str | Path, seed: int, changes: dict[str, Any], folder: Path, golden: Golden) -> Flown:
    """Fly the changed scenario; the run directory is created in ``folder``."""
    of = changed(str(scenario), changes)
    vehicle = load(find("vehicles", of.vehicle), VehicleConfig)
    number = 1
    while (directory := folder / f"{of.name}-{seed}-{number}").exists():
        number += 1
    directory.mkdir()
    summary = swarm.fly(Prepared(of, vehicle), seed, directory, lambda _stage, _seconds: None)
    return Flown(directory, summary, of.systems, golden)


def replayed(
    log: Path,
    own: int,
    neighbours: tuple[int, ...] | None,
    target: int | None,
    like: str,
    changes: dict[str, Any],
    golden: Golden,
) -> Replayed:
    """Run a companion over ``log`` and return what it would have sent."""
    config = changed(like, {"companion": changes}).companion
    cast = Roles(own, None if neighbours is None else frozenset(neighbours), target)
    try:
        seen = survey(read_tlog(log), own, str(log))
    except LogError as error:
        raise InputError(str(error)) from None
    check(log, cast, seen)
    return Replayed(f"{log.name}, vehicle {own}", shadow_flight(config, cast, seen, read_tlog(log)), golden)


def changed(name: str, changes: dict[str, Any]) -> Scenario:
    """Return a scenario, by name or file, with ``changes`` merged in, mapping by mapping.

    Raises InputError for invalid changes.
    """
    document = merged(load(find("scenarios", name), Scenario).model_dump(), changes)
    try:
        return Scenario.model_validate(document)
    except ValidationError as error:
        faults = [f"{'.'.join(map(str, one['loc'])) or name}: {one['msg']}" for one in error.errors()]
        raise InputError(*(f"{name}, changed: {fault}" for fault in faults)) from None


def merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return ``base`` with ``changes`` merged in.

    Two mappings under the same key are merged, too, unless the new one names another ``kind``.
    """
    result = deepcopy(base)
    for key, value in changes.items():
        inner = result.get(key)
        # A mapping of another kind has other keys, so it replaces the old one.
        if (
            isinstance(inner, dict)
            and isinstance(value, dict)
            and value.get("kind", inner.get("kind")) == inner.get("kind")
        ):
            value = merged(inner, value)
        result[key] = value
    return result
