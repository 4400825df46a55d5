"""Scenarios with changes, flown or used to replay a log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mavlink_bridge.errors import LogError
from mavlink_bridge.tlog.log import read_tlog
from outrider.errors import InputError
from outrider.scenarios.changes import changed
from outrider.shadow.roles import Roles, check, survey
from outrider.shadow.shadow_run import shadow_flight
from outrider.simulation.preparation import prepared
from outrider.swarm import command as swarm
from outrider.testing.flown import Flown, Replayed
from outrider.testing.golden import Golden


def flown(scenario: str | Path, seed: int, changes: dict[str, Any], folder: Path, golden: Golden) -> Flown:
    """Fly the changed scenario; the run directory is created in ``folder``."""
    of = changed(str(scenario), changes)
    ready = prepared(of, of.name)
    number = 1
    while (directory := folder / f"{of.name}-{seed}-{number}").exists():
        number += 1
    directory.mkdir()
    summary = swarm.fly(ready, seed, directory, lambda _stage, _seconds: None)
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
