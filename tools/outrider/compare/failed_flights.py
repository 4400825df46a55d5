"""Flights of a comparison that failed, as scenario files to look at and to fly again."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from pathlib import Path

from pydantic import ValidationError

from outrider.compare.scene import Scene, scenario_of
from outrider.errors import InputError
from outrider.runs import whole_file
from outrider.sweep.cells import Cell, scenario_text

FOLDER = "failed"


def write(folder: Path, failed: Iterable[tuple[Cell, int, list[str]]]) -> list[Path]:
    """Write the scenario of each flight, a cell, a seed and its faults, to ``folder``/failed.

    A file begins with the faults and the command that flies it. A flight whose scenario cannot be drawn has
    no file. Files that an earlier command left there are removed. Returns the files.
    """
    files = []
    for old in (folder / FOLDER).glob("*-seed*.yaml"):
        old.unlink()
    for cell, seed, faults in failed:
        try:
            scenario = scenario_of(Scene.model_validate_json(cell.document), seed)
        except (InputError, ValidationError):
            continue
        path = folder / FOLDER / f"{cell.slug}-seed{seed}.yaml"
        command = shlex.join(["outrider", "swarm", path.name, "--seed", str(seed)])
        # Line breaks would end the YAML comment, and YAML has no unprintable characters.
        words = f"{cell.label}, seed {seed}: {'; '.join(faults)}".split()
        head = "".join(one for one in " ".join(words) if one.isprintable())
        path.parent.mkdir(exist_ok=True)
        whole_file.write(path, f"# {head}\n# {command}\n{scenario_text(scenario)}")
        files.append(path)
    return files
