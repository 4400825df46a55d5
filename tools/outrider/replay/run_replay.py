"""Replay of all companions of a run directory."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from companion.values.components import COMPONENT
from mavlink_bridge.tlog.log import read_tlog
from outrider.errors import Fault, InputError
from outrider.replay.companion_replay import Replayed, replay_companion
from outrider.resources import config_root, find
from outrider.runs import names
from outrider.runs.configuration import resolved
from outrider.runs.steps_file import read_steps
from outrider.simulation.fleet import Fleet
from outrider.simulation.vehicles import EPOCH
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig

_ALLOWED = "allowed: what outrider swarm SCENARIO --out leaves"
_STEPS_PER_REPORT = 256
"""Number of steps between two progress reports."""

Watch = Callable[[str, float], None]


def again(directory: Path, watch: Watch = lambda _words, _share: None) -> tuple[Replayed, ...]:
    """Create the companions of the run in ``directory`` from its configuration; re-run them from its logs.

    ``watch`` receives the name of the log and the share that is done. Raises InputError where there is no
    run, or a vehicle's log or steps are missing.
    """
    flown = resolved(directory, _ALLOWED, "{} with --own ID, or --list")
    vehicle = load(find("vehicles", flown.scenario.vehicle), VehicleConfig)
    fleet = Fleet(flown.scenario, vehicle, flown.seed, config_root() / "logs")
    for system in fleet.systems:
        for name in (names.log(system), names.steps(system)):
            if not (directory / name).is_file():
                raise InputError(Fault(str(directory), f"{name} is missing; {_ALLOWED}"))
    found = []
    for k, system in enumerate(fleet.systems):
        steps = read_steps(directory / names.steps(system)).tolist()
        shares = _Shares(watch, names.log(system), (k, len(fleet.systems)), len(steps))
        records = read_tlog(directory / names.log(system))
        # The CPU clock returns 0: planning time is irrelevant here.
        companion = fleet.companion(k, lambda: 0, EPOCH)
        found.append(replay_companion(companion, (system, COMPONENT), steps, records, shares.step))
    return tuple(found)


class _Shares:
    """Progress reports to ``watch`` for the ``steps`` of one of several logs.

    ``which``: index of the log, and number of logs.
    """

    def __init__(self, watch: Watch, name: str, which: tuple[int, int], steps: int) -> None:
        self._watch, self._name, self._which, self._steps = watch, name, which, steps
        self._done = 0

    def step(self, _now: int) -> None:
        """Count one more step."""
        self._done += 1
        if self._done % _STEPS_PER_REPORT == 0 or self._done == self._steps:
            before, logs = self._which
            self._watch(self._name, (before + self._done / self._steps) / logs)
