"""Shipped files and runs, each with one line of description."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final, NamedTuple

import yaml

from outrider.resources import config_root
from outrider.runs import names
from outrider.runs.configuration import CONFIGURATION

KINDS: Final = ("scenarios", "sweeps", "scenes", "vehicles", "cameras", "companions")
"""Kinds of shipped files: the folders of the configuration."""
RUNS: Final = "runs"
_LONGEST: Final = 400
"""Largest number of characters of a description that is read from a comment."""


class Item(NamedTuple):
    """Something that a command takes: its ``name``, and what it is."""

    name: str
    description: str


def items(kind: str) -> list[Item]:
    """Return the shipped files of ``kind``, or the runs in the folder ``runs``."""
    if kind == RUNS:
        return [_run(path) for path in sorted(Path(RUNS).glob(f"*/{CONFIGURATION}"))]
    return [Item(path.stem, _description(path)) for path in sorted((config_root() / kind).glob("*.yaml"))]


def _description(path: Path) -> str:
    """Return the description in a shipped file; without one, the first sentence of its comment."""
    text = path.read_text(encoding="utf-8")
    found = yaml.safe_load(text).get("description")
    if found:
        return str(found)
    comment = [line.lstrip("# ") for line in text.splitlines() if line.startswith("#")][1:]
    said = " ".join(comment)[:_LONGEST]
    for end in (". ", ": "):
        said = said.split(end)[0]
    return said.rstrip(".")


def _run(configuration: Path) -> Item:
    """Return a run and how it ended, by its summary."""
    directory = configuration.parent
    try:
        summary = json.loads((directory / names.SUMMARY).read_text(encoding="utf-8"))
        said = _outcome(summary)
    except (OSError, ValueError, AttributeError):
        said = "not finished"
    return Item(str(directory), said)


def _outcome(summary: dict[str, object]) -> str:
    parts = []
    if summary.get("failure"):
        parts.append(str(summary["failure"]))
    if summary.get("converged") is not None:
        time = summary.get("convergence_time_s")
        parts.append(f"converged after {time} s" if summary["converged"] else "not converged")
    if isinstance(least := summary.get("min_separation_m"), int | float):
        parts.append(f"least separation {least:.2f} m")
    if violations := summary.get("d_min_violations"):
        parts.append(f"{violations} violations of d_min")
    return ", ".join(parts) or "finished"
