"""Display of the vehicles on standard error.

On a terminal it is a table; elsewhere one line per vehicle at first, then one line per event.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console

from outrider.sitl_server.addresses import Address
from outrider.sitl_server.event_feed import EventFeed
from outrider.sitl_server.request import Request
from outrider.sitl_server.screen import Screen
from outrider.sitl_server.shared_page import SharedPage
from outrider.terminal.lines import say


def announce(asked: Request) -> None:
    """Announce the start on a terminal: the first start on a machine compiles for some seconds."""
    if sys.stderr.isatty():
        say(f"starting {asked.count} × {asked.vehicle.name}, {asked.flavour} …")


@contextmanager
def watching(asked: Request, places: Sequence[Address], board: SharedPage) -> Iterator[Callable[[], None]]:
    """Show the vehicles, which are up; yield a function to call a few times a second."""
    console = Console(stderr=True)
    if console.is_terminal:
        screen = Screen(asked, places, board, console)
        with screen.live:
            yield screen.look
        return
    for system, place in zip(asked.systems, places, strict=True):
        ends = " ".join(map(str, place.endpoints))
        say(f"vehicle {system} ({asked.flavour}, {asked.vehicle.name}): {ends}")
    feed = EventFeed(asked, board)

    def look() -> None:
        for line in feed.look():
            say(line)

    yield look
