"""Workers of a command that flies: processes of this machine, or those of a Dask scheduler."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass

from outrider.errors import InputError
from outrider.processes.cores import cores
from outrider.sweep.execution import WALL_LIMIT_S, Workers
from outrider.sweep.pool import Pool


@dataclass(frozen=True)
class Machines:
    """Where runs are flown, and how long one of them may take.

    ``jobs``: number of processes on this machine, by default one for each core; ``scheduler``: the address of
    a Dask scheduler in their place. ``wall_limit_s``: longest wall time of a run. Raises InputError if both
    processes and a scheduler are asked for.
    """

    jobs: int | None = None
    scheduler: str | None = None
    wall_limit_s: float = WALL_LIMIT_S

    def __post_init__(self) -> None:
        """Refuse processes together with a scheduler."""
        if self.jobs is not None and self.scheduler is not None:
            raise InputError(
                "--jobs does not go with --scheduler; allowed: one of them: a Dask worker flies as many runs"
                " at a time as it has threads (dask worker --nthreads)"
            )

    def workers(self, run: str) -> AbstractContextManager[Workers]:
        """Return the workers, which fly by the function ``run``, ``module:function``."""
        if self.scheduler is None:
            return Pool(run, self.jobs or cores(), self.wall_limit_s)
        from outrider.sweep.cluster import Cluster

        return Cluster(self.scheduler, run, self.wall_limit_s)
