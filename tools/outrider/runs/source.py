"""Source of an export: a run directory, or a single log."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

from mavlink_bridge.errors import LogError
from outrider.errors import Fault, InputError
from outrider.logs.message_stream import Log
from outrider.runs import names
from outrider.runs.arrays import Motion, Plans, read_motion, read_plans
from outrider.runs.configuration import CONFIGURATION, configured
from outrider.scenarios.scenario import Scenario

ALLOWED: Final = "allowed: a directory that outrider swarm left, or a tlog"


class Run(NamedTuple):
    """All available data of a flight.

    ``motion`` is None for a run that was stopped; a bare log has no ``scenario``, and one entry in ``logs``.
    ``unread``: a line for each log that could not be used.
    """

    source: Path
    scenario: Scenario | None
    seed: int
    motion: Motion | None
    gradients: Plans | None
    plan_times: Plans | None
    logs: tuple[Log, ...]
    unread: tuple[str, ...]


def read(source: Path, of_log: str = "{}") -> Run:
    """Read ``source``, a run directory or a tlog; ``of_log`` as for ``configured``.

    Raises InputError if it is neither, or if it holds nothing to export.
    """
    if not source.exists():
        raise InputError(Fault(str(source), f"no such file or directory; {ALLOWED}"))
    return _run(source, of_log) if source.is_dir() else _bare(source)


def _bare(path: Path) -> Run:
    log = Log(path, None)
    try:
        log.check()
    except LogError as error:
        raise InputError(f"{error}; {ALLOWED}") from None
    return Run(path, None, 0, None, None, None, (log,), ())


def _run(directory: Path, of_log: str) -> Run:
    if not (directory / CONFIGURATION).is_file():
        raise InputError(Fault(str(directory), f"not a run directory: no {CONFIGURATION} in it; {ALLOWED}"))
    resolved = configured(directory, ALLOWED, of_log)
    scenario = resolved.scenario
    motion = read_motion(directory / names.FLIGHT, len(scenario.systems), len(scenario.moving))
    gradients = plan_times = None
    if motion is not None:
        gradients = read_plans(directory / names.PLANS, "gradient", 3, motion.start_us)
        plan_times = read_plans(directory / names.PLAN_TIMES, "plan_ms", None, motion.start_us)
    logs, unread = [], []
    for system in scenario.systems:
        log = Log(directory / names.log(system), system)
        try:
            log.check()
            logs.append(log)
        except LogError as error:
            unread.append(str(error))
    if motion is None and not logs:
        raise InputError(
            Fault(str(directory), f"holds neither {names.FLIGHT} nor a log vehicle-N.tlog; {ALLOWED}")
        )
    return Run(directory, scenario, resolved.seed, motion, gradients, plan_times, tuple(logs), tuple(unread))
