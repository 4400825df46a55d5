"""Live display of the flight on a terminal: state, latest events, and the line being typed."""

from __future__ import annotations

import math
import time
from collections import deque
from typing import IO, Final, cast

from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from outrider.onboard.flight import Flight
from outrider.onboard.orders import WORDS
from outrider.onboard.status import State
from outrider.onboard.terminal import Terminal

_REFRESH: Final = 0.2
"""Time between two pictures (s)."""
_EVENTS: Final = 8


class Screen:
    """Display on ``terminal``.

    ``look`` may be called at any rate. Nothing is drawn while the terminal takes no output. ``tell`` receives
    the lines of the event log.
    """

    def __init__(self, terminal: Terminal) -> None:
        self._terminal = terminal
        self.flight: Flight | None = None
        self.pending = ""
        self._events: deque[str] = deque(maxlen=_EVENTS)
        self._drawn = 0.0
        # No refresh thread: this process forks the one that flies.
        self.live = Live(console=Console(file=cast(IO[str], terminal)), auto_refresh=False)

    def tell(self, line: str) -> None:
        """Add an event line."""
        self._events.append(line)

    def look(self) -> None:
        """Draw the current state, at most every 0.2 s."""
        now = time.monotonic()
        if now - self._drawn >= _REFRESH and self.flight is not None and self._terminal.takes:
            self._drawn = now
            self.live.update(self._picture(self.flight), refresh=True)

    def _picture(self, flight: Flight) -> Group:
        table = Table(
            title=_title(flight),
            title_justify="left",
            box=box.SIMPLE,
            show_header=False,
            show_edge=False,
            padding=(0, 2, 0, 0),
        )
        for name, text in rows(flight.state, flight.waiting).items():
            table.add_row(name, Text(text))
        words = ", ".join(WORDS)
        return Group(
            table,
            *(Text(line, no_wrap=True, overflow="ellipsis") for line in self._events),
            Text(f"{words} > {self.pending}▏", no_wrap=True),
        )


def rows(state: State, waiting: str) -> dict[str, str]:
    """Return the rows of the display, as text by name."""
    found = {"phase": f"{state.phase}, waits for {waiting}" if waiting else state.phase}
    motors = "armed" if state.armed else "disarmed"
    found["mode"] = f"{state.mode or 'not received'}, {motors}{', ours' if state.guided else ''}"
    if state.position is not None and state.velocity is not None:
        east, north, up = state.position
        found["position"] = (
            f"{east:.1f} east, {north:.1f} north, {up:.1f} up m; {math.hypot(*state.velocity):.1f} m/s"
        )
    ages = {"own": state.own_ms, "target": state.target_ms, **state.neighbours_ms}
    found["heard"] = ", ".join(f"{who} {_age(age)}" for who, age in ages.items())
    p50, p99 = state.plan_ms
    found["plans"] = f"{state.plans}, {p50:.1f} / {p99:.1f} ms (p50, p99); held {state.held}"
    found["set-points"] = f"{state.setpoints}{'; would: ' + state.would if state.would else ''}"
    if abs(state.rate - 1.0) > 0.01:
        found["clock"] = f"{state.rate:.2f} times as fast as the wall's"
    if state.concerns:
        found["concerns"] = "; ".join(state.concerns)
    return found


def _age(age: int | None) -> str:
    """Return an age in ms as text."""
    if age is None:
        return "never"
    return f"{max(age, 0)} ms ago" if age < 10_000 else f"{age / 1000.0:.0f} s ago"


def _title(flight: Flight) -> str:
    asked = flight.asked
    way = "dry run, nothing is steered · " if asked.dry_run else ""
    return f"vehicle {asked.system} · {way}{asked.endpoints['autopilot']} · {flight.state.at:.0f} s"
