"""Runs for a worker to call in the tests of sweeps: fast, and the same for the same task."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from typing import Any

import numpy as np

from outrider.sweep.tasks import Task

RUNS = __name__
"""This module, as a worker imports it."""
FOLDER = "OUTRIDER_TEST_FOLDER"
"""In the environment: where the runs that are not the same each time keep count."""


def swap(task: Task) -> dict[str, Any]:
    """Figures as of a flight, drawn from the task alone."""
    random = np.random.default_rng([task.seed, *task.key.encode()])
    converged = bool(random.random() > 0.1)
    # At least one among the first seeds, whatever the key of the cell makes of the rest.
    violations = int(task.seed == 7 or random.random() < 0.05)
    return {
        "converged": converged,
        "convergence_time_s": round(float(random.gamma(20.0, 0.5)), 3) if converged else None,
        "min_separation_m": round(
            float(random.uniform(0.2, 0.5) if violations else random.uniform(0.6, 2.0)), 4
        ),
        "min_obstacle_distance_m": None,
        "d_min_m": 0.5,
        "span_m": 0.63,
        "d_min_violations": violations,
        "yaw_error_deg": {"p50": 1.0, "p95": round(float(random.uniform(2.0, 9.0)), 3)},
        "tracking_error_m": {"p95": round(float(random.uniform(0.02, 0.1)), 4), "max": 0.2},
        "failure": None,
    }


def fine(task: Task) -> dict[str, Any]:
    """No violation, converged."""
    return {"converged": True, "convergence_time_s": 7.0, "min_separation_m": 1.0, "d_min_violations": 0}


def kills_sweep(task: Task) -> dict[str, Any]:
    """`swap`; some seeds kill the whole sweep when they are tried first, as a loss of power would."""
    if task.seed in (4, 13, 14) and _count(task) == 1:
        os.kill(os.getppid(), signal.SIGKILL)
        signal.pause()
    return swap(task)


def counted(task: Task) -> dict[str, Any]:
    """`fine`, and every start leaves a line."""
    _count(task)
    return fine(task)


def breaks(task: Task) -> dict[str, Any]:
    """Raises for every third seed, and prints."""
    sys.stdout.write("this is no result\n")
    if task.seed % 3 == 0:
        raise RuntimeError(f"seed {task.seed}\nis bad")
    return fine(task)


def breaks_badly(task: Task) -> dict[str, Any]:
    """Raises for every third seed, in words that are a program elsewhere."""
    if task.seed % 3 == 0:
        raise RuntimeError(f"<script> {task.seed} is bad")
    return fine(task)


def stuck_or_broken(task: Task) -> dict[str, Any]:
    """None converges, and every third seed raises."""
    return {**breaks(task), "converged": False, "convergence_time_s": None}


def only_others(task: Task) -> dict[str, Any]:
    """All converge but a vehicle whose companion has ended for good."""
    return {**fine(task), "converged": False, "convergence_time_s": None, "others_converge_s": 6.2}


def no_json(task: Task) -> dict[str, Any]:
    """Values that JSON does not have."""
    return {"min_separation_m": float("nan")}


def kills_once(task: Task) -> dict[str, Any]:
    """Seed 3 takes its worker down, the first time."""
    if task.seed == 3 and _count(task) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return fine(task)


def kills_always(task: Task) -> dict[str, Any]:
    """Seed 3 takes its worker down whenever it is tried."""
    if task.seed == 3:
        _count(task)
        os.kill(os.getpid(), signal.SIGKILL)
    return fine(task)


def leaves(task: Task) -> dict[str, Any]:
    """Seed 3 ends its worker from within."""
    if task.seed == 3:
        os._exit(7)
    return fine(task)


def hangs(task: Task) -> dict[str, Any]:
    """Seed 3 never ends."""
    if task.seed == 3:
        _count(task)
        signal.pause()
    return fine(task)


def waits(task: Task) -> dict[str, Any]:
    """Says that it has begun, and never ends."""
    _count(task)
    signal.pause()
    return fine(task)


def interrupted(task: Task) -> dict[str, Any]:
    """Seed 5 is Ctrl-C at the sweep."""
    if task.seed == 5 and _count(task) == 1:
        os.kill(os.getppid(), signal.SIGINT)
        signal.pause()
    return fine(task)


def threads(task: Task) -> dict[str, Any]:
    """What the libraries are told about threads, and who ran it."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    return {"threads": [os.environ[name] for name in names], "pid": os.getpid()}


def _count(task: Task) -> int:
    """Leave a line for this start of the run; how many there are."""
    path = Path(os.environ[FOLDER]) / f"{task.key}-{task.seed}"
    with path.open("a") as file:
        file.write(f"{os.getpid()}\n")
    return len(path.read_text().splitlines())


def kills_machine(task: Task) -> dict[str, Any]:
    """`swap`; the first one with seed 5, of whatever cell, takes down what has started its process."""
    if task.seed == 5 and _first("machine"):
        os.kill(os.getppid(), signal.SIGKILL)
        signal.pause()
    return swap(task)


def kills_other(task: Task) -> dict[str, Any]:
    """`swap`; the first one with seed 5 ends the process whose id is in the file ``other``, by the signal
    that is there too."""
    if task.seed == 5 and _first("other-begun"):
        other, which = (Path(os.environ[FOLDER]) / "other").read_text().split()
        os.kill(int(other), int(which))
        signal.pause()
    return swap(task)


def _first(name: str) -> bool:
    try:
        (Path(os.environ[FOLDER]) / name).touch(exist_ok=False)
    except FileExistsError:
        return False
    return True
