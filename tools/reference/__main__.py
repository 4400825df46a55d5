"""Writes the reference pages: ``python -m reference [FOLDER]``, by default docs/."""

from __future__ import annotations

import sys
from pathlib import Path

from reference import api, settings

PAGES = {
    "api.md": api.page,
    "companion.md": settings.companion,
    "scenario.md": settings.scenario,
    "vehicle.md": settings.vehicle,
}


def main() -> None:
    """Write every page."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "docs"
    for name, page in PAGES.items():
        (folder / name).write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
