"""Flights of a comparison that failed, as scenario files to look at and to fly again."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from pydantic import ValidationError

from outrider.compare.scene import Scene, scenario_of
from outrider.errors import InputError
from outrider.runs import whole_file
from outrider.sweep.cells import Cell
from outrider.sweep.regressions import file_text

FOLDER = "failed"


class FailedFlight(NamedTuple):
    """A flight of ``cell`` with ``seed`` and its ``faults``, a clause each."""

    cell: Cell
    seed: int
    faults: list[str]

    @property
    def text(self) -> str:
        """The flight and its faults."""
        return f"{self.cell.label}, seed {self.seed}: {'; '.join(self.faults)}"


def write(folder: Path, failed: Iterable[FailedFlight]) -> list[Path]:
    """Write the scenario of each flight to ``folder``/failed.

    A file begins with the faults and the command that flies it. A flight whose scenario cannot be drawn has
    no file. Files that an earlier command left there are removed. Returns the files.
    """
    files = []
    for old in (folder / FOLDER).glob("*-seed*.yaml"):
        old.unlink()
    for one in failed:
        try:
            scenario = scenario_of(Scene.model_validate_json(one.cell.document), one.seed)
        except (InputError, ValidationError):
            continue
        path = folder / FOLDER / f"{one.cell.slug}-seed{one.seed}.yaml"
        path.parent.mkdir(exist_ok=True)
        whole_file.write(path, file_text(path.name, one.text, one.seed, scenario))
        files.append(path)
    return files
