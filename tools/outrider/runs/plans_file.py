"""Writer of ``plans.npz`` of a run directory: ∇J of every plan, for plots."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from outrider.runs.outcome import Outcome


def write_plans(flight: Outcome, path: Path) -> None:
    """Write arrays with a row for each plan.

    ``system``; ``time_s`` after the goal event, on the companion's clock; ``gradient`` (n, 3), ∇J divided by
    Ω_t, fleet-local ENU, m. Lock-step writes the same bytes each time.
    """
    logs = flight.plan_logs
    start = flight.clock_start or 0
    np.savez_compressed(
        path,
        system=np.repeat(np.array(flight.systems[: len(logs)]), [len(log.times) for log in logs]),
        time_s=np.concatenate([(log.times - start) * 1e-6 for log in logs]),
        gradient=np.concatenate([log.gradients for log in logs]),
    )
