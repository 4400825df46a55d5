"""Names of the nodes and files of a run, and the number of each link in a log."""

from __future__ import annotations

TARGET, OPERATOR = "target", "operator"
SUMMARY, FLIGHT, PLANS, PLAN_TIMES = "summary.json", "flight.npz", "plans.npz", "plan_times.npz"
LINK_NUMBERS = {"autopilot": 0, "swarm": 1, "target": 2, "ground": 3}
"""Link numbers in the low two bits of a tlog's time stamps."""


def companion(system: int) -> str:
    """Return the name of the companion of the vehicle with this system id."""
    return f"companion-{system}"


def backup_node(system: int) -> str:
    """Return the name of the backup node, which continues the plan when the companion is silent."""
    return f"backup-{system}"


def autopilot(system: int) -> str:
    """Return the name of the autopilot of this vehicle."""
    return f"sitl-{system}"


def moving(system: int) -> str:
    """Return the name of the moving obstacle with this system id."""
    return f"moving-{system}"


BACKUP_LOGS = "backup-{}"
"""Folder with the log of the n-th backup process of a companion."""


def log(system: int) -> str:
    """Return the file name of the vehicle's tlog."""
    return f"vehicle-{system}.tlog"


def steps(system: int) -> str:
    """Return the name of the file with the step times of the vehicle's companion."""
    return f"vehicle-{system}.steps.npz"
