"""What the nodes of a run are called, and the number that each link has in a log."""

from __future__ import annotations

TARGET, OPERATOR = "target", "operator"
LINK_NUMBERS = {"autopilot": 0, "swarm": 1, "target": 2, "ground": 3}
"""Link numbers in the low two bits of a tlog's time stamps."""


def companion(system: int) -> str:
    """The companion of the vehicle with this system id."""
    return f"companion-{system}"


def helm(system: int) -> str:
    """What carries its plan on when the companion is silent."""
    return f"helm-{system}"


def autopilot(system: int) -> str:
    """Its autopilot."""
    return f"sitl-{system}"


def moving(system: int) -> str:
    """The moving obstacle with this system id."""
    return f"moving-{system}"


def log(system: int) -> str:
    """The file of its tlog."""
    return f"vehicle-{system}.tlog"


def steps(system: int) -> str:
    """The file that says when its companion was stepped."""
    return f"vehicle-{system}.steps.npz"
