"""Live table of the vehicles and the latest events on a terminal."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Sequence
from typing import Final, Literal

from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from outrider.logs.flight_modes import mode_name
from outrider.sitl_server.addresses import Address
from outrider.sitl_server.event_feed import EventFeed
from outrider.sitl_server.figures import factor
from outrider.sitl_server.request import Request
from outrider.sitl_server.shared_page import Pace, SharedPage, VehicleSnapshot

_REFRESH_S: Final = 0.5
"""Time between two pictures (s)."""
_COUNT_WINDOW: Final = 4
"""Number of pictures over which messages per second are counted."""
_PACE_WINDOW: Final = 11
"""Number of pictures (5 s) over which the real-time factor is averaged; its inputs change once a second."""
_EVENT_LINES: Final = 6
_FRAME_LINES: Final = 6
# Lines of the terminal that are neither vehicles nor events.
_WIDTH_WITH_HOSTS: Final = 96
# Terminal width (columns) from which there is room for hosts.
_COLUMNS: Final[dict[str, Literal["left", "right"]]] = {
    "id": "right",
    "port": "left",
    "mode": "left",
    "arm": "left",
    "east": "right",
    "north": "right",
    "up": "right",
    "m/s": "right",
    "bat.": "right",
    "in/s": "right",
    "out/s": "right",
    "peers": "right",
}


class Screen:
    """Live table; ``look`` may be called at any rate, the table is drawn twice a second."""

    def __init__(
        self, asked: Request, places: Sequence[Address], board: SharedPage, console: Console
    ) -> None:
        self._asked, self._places, self._board = asked, places, board
        self._console = console
        self._event_feed = EventFeed(asked, board)
        self._events: deque[str] = deque(maxlen=_EVENT_LINES)
        self._counts: deque[tuple[float, list[tuple[int, int]]]] = deque(maxlen=_COUNT_WINDOW)
        self._paces: deque[list[Pace]] = deque(maxlen=_PACE_WINDOW)
        self._drawn = 0.0
        # No refresh thread, which would take CPU time from the vehicles' processes.
        self.live = Live(console=console, auto_refresh=False)

    def look(self) -> None:
        """Draw the current state, at most twice a second."""
        self._events.extend(self._event_feed.look())
        now = time.monotonic()
        if now - self._drawn >= _REFRESH_S:
            self._drawn = now
            self.live.update(self._picture(now), refresh=True)

    def _picture(self, now: float) -> Group:
        every = [self._board.snapshot(index) for index in range(self._asked.count)]
        self._counts.append((now, [(snapshot.received, snapshot.sent) for snapshot in every]))
        shown = max(1, min(self._asked.count, self._console.size.height - _FRAME_LINES - _EVENT_LINES))
        table = Table(
            title=self._title(), title_justify="left", box=box.SIMPLE, padding=(0, 1, 0, 0), show_edge=False
        )
        for name, justify in _COLUMNS.items():
            table.add_column(name, justify=justify, no_wrap=True)
        for index in range(shown):
            table.add_row(*self._row(index, every[index]))
        more = f"and {self._asked.count - shown} more · " if shown < self._asked.count else ""
        table.caption = f"{more}Ctrl-C ends"
        return Group(table, *(Text(line) for line in self._events))

    def _title(self) -> str:
        asked = self._asked
        self._paces.append(self._board.paces())
        first, last = self._paces[0], self._paces[-1]
        late = max(pace.late_p99 for pace in last) / asked.speed
        return (
            f"{asked.count} × {asked.vehicle.name}, {asked.flavour} · {last[0].simulated:.0f} s"
            f" · {factor(last, first):.2f} × real time · {late:.1f} ms late (p99)"
        )

    def _row(self, index: int, snapshot: VehicleSnapshot) -> tuple[str, ...]:
        (then, before), (now, counts) = self._counts[0], self._counts[-1]
        elapsed = max(now - then, 1e-3)
        received, sent = (
            (new - old) / elapsed for new, old in zip(counts[index], before[index], strict=True)
        )
        place = self._places[index].pymavlink
        if self._console.size.width < _WIDTH_WITH_HOSTS:
            kind, _, rest = place.partition(":")
            place = f"{kind[:3]}:{rest.rpartition(':')[2]}"
        return (
            str(self._asked.systems[index]),
            place,
            mode_name(self._asked.flavour, snapshot.custom_mode),
            "yes" if snapshot.armed else "",
            # The sum turns −0.0 of a vehicle on the ground into 0.0.
            *(f"{round(part, 1) + 0.0:.1f}" for part in snapshot.position),
            f"{math.hypot(*snapshot.velocity):.1f}",
            f"{100.0 * snapshot.battery:.0f}%",
            f"{received:.0f}",
            f"{sent:.0f}",
            str(snapshot.clients),
        )
