"""Changes made by hand during a simulated flight: each change once, and a record of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from outrider.scene.view_commands import ViewCommands

FILE = "orders.json"
"""Name of the record in the run directory; it exists only if there were changes."""


class Change(NamedTuple):
    """The values of ``ViewCommands`` that are new; None for the others."""

    methods: str | None = None
    loss: float | None = None
    target: tuple[float, float, float] | None = None


class Orders:
    """Changes of one flight; ``given``: (s after the goal event or None before it, the change)."""

    def __init__(self) -> None:
        self.given: list[tuple[float | None, Change]] = []
        self._last = ViewCommands()

    def new(self, commands: ViewCommands, seconds: float | None) -> Change | None:
        """Return the values of ``commands`` that are new, and record them; None if there are none."""
        last, self._last = self._last, commands
        change = Change(
            commands.methods if commands.methods != last.methods else None,
            commands.loss if commands.loss != last.loss else None,
            commands.target if commands.moves > last.moves else None,
        )
        if change == Change():
            return None
        self.given.append((seconds, change))
        return change

    def write(self, directory: Path) -> None:
        """Write the changes to ``directory``, if there are any."""
        if self.given:
            rows = [
                {"time_s": None if seconds is None else round(seconds, 3)}
                | {name: value for name, value in change._asdict().items() if value is not None}
                for seconds, change in self.given
            ]
            (directory / FILE).write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
