"""Command ``outrider gallery``: flies the selected scenarios, resumable, and writes the page of pictures."""

from __future__ import annotations

import sys
from pathlib import Path

from outrider.errors import InputError
from outrider.gallery import figures
from outrider.gallery.flying import RUN
from outrider.gallery.page import TITLE, page
from outrider.gallery.showings import GalleryPanel, cells_of, chosen, scenarios, showings
from outrider.interruption import INTERRUPTED
from outrider.runs import whole_file
from outrider.sweep import directory as places
from outrider.sweep.cells import scenario_of, task
from outrider.sweep.comparison import Flown, flown
from outrider.sweep.execution import header
from outrider.sweep.runs import run_of
from outrider.sweep.workers import Machines

SEED = 1
PAGE = "README.md"


def gallery(
    names: tuple[str, ...] = (),
    jobs: int | None = None,
    out: Path | None = None,
    to: Path | None = None,
    run: str = RUN,
) -> int:
    """Fly and draw the scenarios ``names``, or all, and return the exit status.

    The status is 0 if all flights succeeded, 1 after a failed flight, and 3 after an interruption. A method
    that gets stuck or violates d_min is a result that the picture shows, no failure. The journal is written
    to ``out`` (default ``runs/sweep-gallery``); the page ``README.md`` and its pictures to ``to`` (default
    ``out``). Raises InputError for an unknown scenario, or if ``to`` holds a README.md that is no gallery.
    """
    shown = showings(chosen(names))
    found = cells_of(shown)
    folder = places.prepare(out, "gallery")
    there = folder if to is None else to
    _check(there)
    # The header covers all scenarios, so that one journal can hold a few first and the rest later.
    whole = header("gallery", cells_of(showings(scenarios())))
    entries = flown(whole, found, (SEED,), folder, run, Machines(jobs))
    if entries is None:
        return INTERRUPTED
    by_cell = dict(zip(shown, (cell.key for cell in found), strict=True))
    panels = {name: _panels(name, shown, by_cell, entries) for name in dict.fromkeys(s for s, _ in shown)}
    reported = {
        showing.scenario: scenario_of(task(cell, SEED)).description
        for showing, cell in zip(shown, found, strict=True)
    }
    for name, of in panels.items():
        figures.draw(name, of, there / f"{name}.png")
    whole_file.write(there / PAGE, page(panels, reported, SEED))
    sys.stderr.write(f"page and pictures: {there}\n")
    return 1 if any(run.what for of in panels.values() for _, run, _ in of) else 0


def _check(folder: Path) -> None:
    """Create the page's ``folder``. Raises InputError if this fails, or if its README.md is no gallery."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--page {folder}: cannot be made: {error.strerror}") from None
    if (folder / PAGE).exists() and not (folder / PAGE).read_bytes().startswith(TITLE.encode()):
        raise InputError(f"--page {folder}: holds a {PAGE} that is no gallery; nothing is overwritten")


def _panels(
    name: str, shown: tuple[GalleryPanel, ...], keys: dict[GalleryPanel, str], entries: Flown
) -> list[figures.Panel]:
    panels: list[figures.Panel] = []
    for showing in shown:
        if showing.scenario == name:
            entry = entries[keys[showing], SEED]
            scene = None if entry.summary is None else entry.summary.get("scene")
            panels.append((showing.way, run_of(entry), scene))
    return panels
