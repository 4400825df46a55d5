"""``configuration.yaml`` of a run directory: the scenario as it was flown, and its seed."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from outrider.aboard.fly_config import FlyConfig
from outrider.errors import Fault, InputError
from outrider.scenario import Scenario
from outrider.yaml_file import load

CONFIGURATION = "configuration.yaml"


class Resolved(BaseModel):
    """The configuration that a run leaves beside its logs."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    seed: int
    scenario: Scenario


def resolved(directory: Path, allowed: str) -> Resolved:
    """What was flown in ``directory``. InputError, which says what is ``allowed``, if it is none of a run."""
    if not directory.is_dir():
        wrong = "not a directory" if directory.exists() else "no such directory"
        raise InputError(Fault(str(directory), f"{wrong}; {allowed}"))
    return configured(directory)


def configured(directory: Path) -> Resolved:
    """The same where ``directory`` and its file are known to be there. What ``outrider fly`` left knows of no
    scenario: then InputError names the logs, which can be used."""
    path = directory / CONFIGURATION
    try:
        return load(path, Resolved)
    except InputError:
        if not _is_of_one_companion(path):
            raise
    logs = " or ".join(str(log) for log in sorted(directory.glob("vehicle-*.tlog"))) or "a log"
    raise InputError(
        Fault(str(directory), f"what outrider fly left is no flight of a scenario; allowed: {logs}")
    )


def _is_of_one_companion(path: Path) -> bool:
    try:
        load(path, FlyConfig)
    except InputError:
        return False
    return True
