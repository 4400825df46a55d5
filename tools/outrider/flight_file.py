"""``flight.npz`` and ``plan_times.npz`` of a run directory: the true motions, and what each plan cost."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from outrider.outcome import Outcome


def write_flight(flight: Outcome, path: Path) -> None:
    """Arrays over T samples (50 Hz) of K vehicles and M moving obstacles, fleet-local ENU, SI, radians; NaN
    where there is nothing.

    ``system`` (K,); ``time_s`` (T,) after the goal event; ``position``, ``velocity``, ``reference`` (what the
    autopilot flies to) (T, K, 3); ``yaw``, ``tilt`` (T, K); ``target`` (T, 3); ``separation`` (T,): least
    since the sample before; ``moving`` (T, M, 3). Lock-step writes the same bytes each time.
    """
    samples = flight.truth.samples()
    start = flight.clock_start or (int(samples.time[0]) if len(samples.time) else 0)
    values = {name: getattr(samples, name).astype(np.float32) for name in _KEPT}
    np.savez_compressed(
        path,
        system=np.array(flight.systems),
        time_s=((samples.time - start) * 1e-6).astype(np.float64),
        **values,
    )


def write_plan_times(flight: Outcome, path: Path) -> None:
    """CPU time ``plan_ms`` (n,) of each plan while the clock ran, and whose it was, ``system`` (n,)."""
    spent = [after.plan_ns[len(before.plan_ns) :] for before, after in flight.tallies]
    np.savez_compressed(
        path,
        system=np.repeat(np.array(flight.systems[: len(spent)]), [len(part) for part in spent]),
        plan_ms=np.array([ns for part in spent for ns in part], dtype=np.float64) * 1e-6,
    )


_KEPT = ("position", "velocity", "reference", "yaw", "tilt", "target", "separation", "moving")
