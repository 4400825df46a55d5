"""``configuration.yaml`` of a run directory: the scenario as it was flown, and its seed."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

import yaml
from pydantic import BaseModel, ConfigDict

from outrider.errors import Fault, InputError
from outrider.scenarios.fly_config import FlyConfig
from outrider.scenarios.scenario import Scenario
from outrider.scenarios.world_file import beside
from outrider.yaml_files.yaml_file import load

CONFIGURATION = "configuration.yaml"


class Resolved(BaseModel):
    """Configuration that a run leaves next to its logs."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    seed: int
    scenario: Scenario

    def with_files(self, folder: Path) -> Self:
        """Return the configuration with the boxes of a world file in ``folder``."""
        return self.model_copy(update={"scenario": self.scenario.with_files(folder)})


def write_scenario(directory: Path, seed: int, scenario: Scenario) -> None:
    """Write the configuration of a run of ``scenario`` to ``directory``; or raise OSError."""
    obstacles, world = beside(scenario.obstacles, directory)
    stated = scenario.model_copy(update={"obstacles": obstacles, "world": world})
    _write(directory, {"seed": seed, "scenario": stated.model_dump(mode="json")})


def write_fly_config(directory: Path, config: FlyConfig) -> None:
    """Write the configuration of a run of ``outrider fly`` to ``directory``; or raise OSError."""
    obstacles, world = beside(config.companion.obstacles, directory)
    companion = config.companion.model_copy(update={"obstacles": obstacles})
    stated = config.model_copy(update={"companion": companion, "world": world})
    _write(directory, stated.model_dump(mode="json"))


def _write(directory: Path, document: dict[str, Any]) -> None:
    text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True)
    (directory / CONFIGURATION).write_text(text, encoding="utf-8")


def resolved(directory: Path, allowed: str, of_log: str | None = None) -> Resolved:
    """Return the configuration of the run in ``directory``.

    Raises InputError, which states what is ``allowed``, if ``directory`` is not a directory, and as
    ``configured`` does; ``of_log`` as for ``configured``.
    """
    if not directory.is_dir():
        wrong = "not a directory" if directory.exists() else "no such directory"
        raise InputError(Fault(str(directory), f"{wrong}; {allowed}"))
    return configured(directory, allowed, of_log)


def configured(directory: Path, allowed: str, of_log: str | None) -> Resolved:
    """Return the configuration of the run in ``directory``, which must exist.

    Raises InputError if the configuration cannot be read, or is that of ``outrider fly``, which has no
    scenario. For a directory of ``outrider fly`` with a log, the error names ``of_log``, with the log's path
    in place of ``{}``; without a log, or if ``of_log`` is None, it names ``allowed``.
    """
    path = directory / CONFIGURATION
    try:
        return load(path, Resolved)
    except InputError:
        if not _is_of_one_companion(path):
            raise
    log = next(iter(sorted(directory.glob("vehicle-*.tlog"))), None)
    if of_log is not None and log is not None:
        allowed = f"allowed: {of_log.format(log)}"
    raise InputError(Fault(str(directory), f"what outrider fly left is no flight of a scenario; {allowed}"))


def _is_of_one_companion(path: Path) -> bool:
    try:
        load(path, FlyConfig)
    except InputError:
        return False
    return True
