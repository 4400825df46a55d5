"""``configuration.yaml`` of a run directory: the scenario as it was flown, and its seed."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict

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
    return load(directory / CONFIGURATION, Resolved)
