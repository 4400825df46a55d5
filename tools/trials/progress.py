"""Progress of a trial: a line for each act, and on a terminal the act and its time."""

from __future__ import annotations

from typing import Self

from rich.console import Console
from rich.status import Status

from outrider.terminal.lines import say
from trials.plan import Plan


class Progress:
    """Progress of a trial of ``plan``; a context manager."""

    def __init__(self, plan: Plan) -> None:
        self._name = plan.name
        self._act = "vehicles and companions start"
        console = Console(stderr=True)
        self._status: Status | None = console.status(self._act) if console.is_terminal else None

    def __enter__(self) -> Self:
        self.tell(0.0, self._act)
        if self._status is not None:
            self._status.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._status is not None:
            self._status.stop()

    def tell(self, now: float, act: str) -> None:
        """Report that an act begins at ``now`` (s)."""
        self._act = act
        line = f"{self._name} {now:7.1f} s  {act}"
        if self._status is None:
            say(line)
        else:
            self._status.console.print(line, highlight=False)

    def look(self, now: float) -> None:
        """Show the time ``now`` (s)."""
        if self._status is not None:
            self._status.update(f"{now:7.1f} s  {self._act}")
