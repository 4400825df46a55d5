"""Runs of ``outrider fly`` as evidence: a directory for each companion, with the logs of its processes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from companion.avoidance.certified.fingerprint import identity
from companion.config.obstacles import Obstacle
from outrider.certify.distances import for_column, of_plans, of_surfaces
from outrider.certify.evidence import Terms, milli
from outrider.certify.ranges import reach_of
from outrider.errors import Fault, InputError
from outrider.runs import names
from outrider.runs.configuration import CONFIGURATION
from outrider.scenarios.fly_config import FlyConfig
from outrider.yaml_files.yaml_file import load


class FlyRun(NamedTuple):
    """One run of ``outrider fly``."""

    directory: Path
    config: FlyConfig

    @property
    def logs(self) -> list[Path]:
        """Its logs: of all companion processes and their backup nodes, the first process first."""
        found = self.directory.rglob(names.log(self.config.system))
        return sorted(found, key=lambda log: (len(log.parts), log))


def fly_runs(directory: Path) -> list[FlyRun]:
    """Return the runs of ``outrider fly`` in ``directory`` and below; an empty list if there are none.

    Runs without committed plans are left out.
    """
    found = []
    for path in sorted(directory.rglob(CONFIGURATION)):
        try:
            config = load(path, FlyConfig)
        except InputError:
            continue
        if config.certified:
            found.append(FlyRun(path.parent, config))
    return found


def logs_of(runs: Iterable[FlyRun]) -> dict[int, list[Path]]:
    """Return the logs of each vehicle, by system id."""
    found: dict[int, list[Path]] = {}
    for run in runs:
        found.setdefault(run.config.system, []).extend(run.logs)
    return found


def obstacles_of(runs: Iterable[FlyRun]) -> dict[int, tuple[Obstacle, ...]]:
    """Return the fixed obstacles that each vehicle knows, by system id.

    Raises InputError if they differ between two runs of one vehicle, whose logs count as one.
    """
    found: dict[int, FlyRun] = {}
    for run in runs:
        first = found.setdefault(run.config.system, run)
        if first.config.companion.obstacles != run.config.companion.obstacles:
            raise InputError(
                Fault(
                    str(run.directory / CONFIGURATION),
                    f"companion.obstacles of vehicle {run.config.system} differ from those in "
                    f"{first.directory}; allowed: the same in all runs of a vehicle",
                )
            )
    return {system: run.config.companion.obstacles for system, run in found.items()}


def is_of_backup(log: Path) -> bool:
    """Return whether ``log`` is that of a backup node."""
    return log.parent.name.startswith(names.BACKUP_LOGS.format(""))


def terms_of_runs(runs: Sequence[FlyRun]) -> Terms:
    """Return the terms on which the companions agree. Raises InputError if two of them do not.

    ``surface`` is a setting of each vehicle; returned is the least.
    """
    terms = [(run, _terms(run.config)) for run in runs]
    least = min(each.surface for _, each in terms)
    terms = [(run, each._replace(surface=least)) for run, each in terms]
    first, agreed = terms[0]
    for run, other in terms[1:]:
        for name, value, wanted in zip(Terms._fields, other, agreed, strict=True):
            if value != wanted:
                raise InputError(
                    Fault(
                        str(run.directory / CONFIGURATION),
                        f"{name} of committed plans is {value}, and {wanted} in {first.directory}; "
                        "allowed: the same for all vehicles",
                    )
                )
    return agreed


def _terms(config: FlyConfig) -> Terms:
    companion, certified = config.settings, config.settings.certified
    return Terms(
        tuple(sorted(certified.fleet)),
        frozenset(),
        certified.dt_us,
        certified.epoch_us,
        companion.horizon.steps + 1,
        identity(companion, config.origin.frame),
        of_plans(companion),
        milli(companion.limits.u_max),
        companion.planar,
        for_column(companion),
        companion.field.downwash,
        of_surfaces(companion),
        reach_of(companion),
        milli(companion.limits.least_u),
        companion.plane_shift,
    )
