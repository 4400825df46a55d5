"""What people see of the vehicles: a table on a terminal; elsewhere a line for each vehicle at first, and
then one for each event. All of it on standard error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console

from outrider.sitl_server.addresses import Address
from outrider.sitl_server.event_feed import Chronicle
from outrider.sitl_server.request import Request
from outrider.sitl_server.screen import Screen
from outrider.sitl_server.shared_page import Board
from outrider.terminal.lines import say


def announce(asked: Request) -> None:
    """On a terminal, that they are being started: the first start on a machine compiles for some seconds."""
    if sys.stderr.isatty():
        say(f"starting {asked.count} × {asked.vehicle.name}, {asked.flavour} …")


@contextmanager
def watching(asked: Request, places: Sequence[Address], board: Board) -> Iterator[Callable[[], None]]:
    """Inside it, call what it gives a few times a second. The vehicles are up."""
    console = Console(stderr=True)
    if console.is_terminal:
        screen = Screen(asked, places, board, console)
        with screen.live:
            yield screen.look
        return
    for system, place in zip(asked.systems, places, strict=True):
        ends = " ".join(map(str, place.endpoints))
        say(f"vehicle {system} ({asked.flavour}, {asked.vehicle.name}): {ends}")
    chronicle = Chronicle(asked, board)

    def look() -> None:
        for line in chronicle.look():
            say(line)

    yield look
