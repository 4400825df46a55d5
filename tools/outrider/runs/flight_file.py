"""Writer of the ``.npz`` files of a run directory: true motions, and CPU times and gradients of plans."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from outrider.runs.outcome import Outcome


def write_flight(flight: Outcome, path: Path) -> None:
    """Write T samples (50 Hz) of K vehicles and M moving obstacles, fleet-local ENU, SI, radians.

    Missing values are NaN. ``system`` (K,); ``time_s`` (T,) after the goal event, which was at ``start_us``
    on the clock of the run (Unix µs, as in the logs) or, if there was none, is the first sample;
    ``position``, ``velocity``, ``reference`` (the position that the autopilot tracks) (T, K, 3); ``yaw``,
    ``tilt`` (T, K); ``target`` (T, 3); ``separation`` (T,): least distance between two vehicles in the air
    since the previous sample, infinite without such a pair; ``moving`` (T, M, 3). Lock-step writes the same
    bytes each time.
    """
    samples = flight.truth.samples()
    start = flight.clock_start or (int(samples.time[0]) if len(samples.time) else 0)
    values = {name: getattr(samples, name).astype(np.float32) for name in _SAMPLE_FIELDS}
    np.savez_compressed(
        path,
        system=np.array(flight.systems),
        start_us=np.int64(start),
        time_s=((samples.time - start) * 1e-6).astype(np.float64),
        **values,
    )


def write_plan_times(flight: Outcome, path: Path) -> None:
    """Write the CPU time ``plan_ms`` (n,) of each plan between the clock's start and its end.

    ``time_s`` (n,): when the plan was due, after the goal event on the companion's clock; ``system`` (n,):
    its vehicle.
    """
    spent = [after.plan_ns[len(before.plan_ns) :] for before, after in flight.tallies]
    due = [after.plan_at[len(before.plan_at) :] for before, after in flight.tallies]
    start = flight.clock_start or 0
    np.savez_compressed(
        path,
        system=np.repeat(np.array(flight.systems[: len(spent)]), [len(part) for part in spent]),
        time_s=(np.array([at for part in due for at in part], dtype=np.int64) - start) * 1e-6,
        plan_ms=np.array([ns for part in spent for ns in part], dtype=np.float64) * 1e-6,
    )


def write_plans(flight: Outcome, path: Path) -> None:
    """Write arrays with a row for each plan.

    ``system``; ``time_s`` after the goal event, on the companion's clock; ``gradient`` (n, 3), the gradient
    ∇J of the cost (eq. (11) of the paper) divided by the weight Ω_t of the final position, fleet-local ENU,
    m. Lock-step writes the same bytes each time.
    """
    logs = flight.plan_logs
    start = flight.clock_start or 0
    np.savez_compressed(
        path,
        system=np.repeat(np.array(flight.systems[: len(logs)]), [len(log.times) for log in logs]),
        time_s=np.concatenate([(log.times - start) * 1e-6 for log in logs]),
        gradient=np.concatenate([log.gradients for log in logs]),
    )


_SAMPLE_FIELDS = ("position", "velocity", "reference", "yaw", "tilt", "target", "separation", "moving")
