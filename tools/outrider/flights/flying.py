"""Flight of a scenario from Python."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from pathlib import Path
from typing import Any

from outrider.arguments import whole
from outrider.errors import InputError
from outrider.flights.flight import Flight
from outrider.runs.directories import new_directory
from outrider.scenarios.changes import changed
from outrider.scenarios.scenario import Scenario
from outrider.simulation.preparation import prepared
from outrider.swarm import command as swarm


def scenario(name: str | Path, **changes: Any) -> Scenario:
    """Return a scenario, shipped or from a file, with some of its keys changed, mapping by mapping.

    For example ``scenario("antipodal-8", vehicles=4, companion={"methods": ["swivel"]})``. Its ``companion``
    is a ``PlannerConfig``. Raises InputError for unknown keys and wrong values.
    """
    return changed(str(name), changes)


def fly(
    scenario: str | Path | Scenario,
    seed: int = 1,
    *,
    out: str | Path | None = None,
    processes: int = 1,
    **changes: Any,
) -> Flight:
    """Fly a scenario in lock-step, as ``outrider swarm`` does, and return the finished flight.

    ``scenario``: a shipped name, a file, or a ``Scenario``; ``changes`` of its keys as for ``scenario()``.
    ``out``: new directory for the flight's files; without it they are in a temporary one that is removed with
    the returned object. The same seed gives the same bytes. Raises InputError before the flight for wrong
    arguments, and OutriderError if it is interrupted.
    """
    seed = whole("seed", seed, least=0)
    processes = whole("processes", processes, least=1)
    if not isinstance(scenario, str | Path | Scenario):
        raise InputError(f"scenario: is a {type(scenario).__name__}; allowed: a name, a file, or a Scenario")
    if out is not None and not isinstance(out, str | Path):
        raise InputError(f"out: is a {type(out).__name__}; allowed: the path of a new directory")
    if isinstance(scenario, Scenario):
        if changes:
            raise InputError("changes: go with the name of a scenario; allowed: a Scenario without changes")
        of = scenario
    else:
        of = changed(str(scenario), changes)
    ready = prepared(of, of.name)
    temporary = out is None
    directory = Path(tempfile.mkdtemp(prefix="outrider-")) if out is None else new_directory(Path(out), "")
    try:
        pace = swarm.Pace(processes=processes)
        swarm.fly(ready, seed, directory, lambda _stage, _seconds: None, pace)
    except BaseException:
        if temporary:
            shutil.rmtree(directory, ignore_errors=True)
        raise
    flight = Flight(directory)
    if temporary:
        weakref.finalize(flight, shutil.rmtree, directory, ignore_errors=True)
    return flight
