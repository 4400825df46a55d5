"""Command ``outrider sitl``: opens the endpoints, starts the vehicles, shows them and ends them."""

from __future__ import annotations

import json
import math
import signal
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final, NamedTuple

from mavlink_bridge.clocks.clock import Clock, WallClock
from mavlink_bridge.errors import EndpointError, LinkError
from mavlink_bridge.links.link import Link
from mavlink_bridge.links.opening import open_link
from outrider.address_scope import exposed
from outrider.errors import InputError
from outrider.interruption import noted
from outrider.sitl_server.addresses import Address, addresses, extra
from outrider.sitl_server.display import announce, watching
from outrider.sitl_server.figures import Value, ready, summary
from outrider.sitl_server.persistence import prepare
from outrider.sitl_server.processes import Processes
from outrider.sitl_server.request import Request

_POLL_PERIOD_S: Final = 0.1
"""Time between two polls of the shared page (s)."""


class Terms(NamedTuple):
    """Conditions of the run; ``seconds``: wall time after which it ends by itself."""

    port_base: int | None
    to: tuple[str, ...]
    host: str
    state: Path | None
    seconds: float | None
    as_json: bool


def run(asked: Request, terms: Terms) -> int:
    """Run until Ctrl-C, SIGTERM or the end of the time limit, and return the exit status.

    Raises InputError if an endpoint cannot be opened, OutriderError if a worker process ends by itself.
    """
    began = time.monotonic()
    prepare(terms.state, asked.flavour, asked.systems)
    places = _addresses(asked, terms)
    processes = Processes(asked, _opened(places, WallClock()), terms.state)
    with noted((signal.SIGINT, signal.SIGTERM)) as stopped:
        try:
            announce(asked)
            processes.start()
            _wait(processes, stopped, asked.count)
            until = math.inf if terms.seconds is None else time.monotonic() + terms.seconds
            if terms.as_json and not stopped:
                _say(ready(asked, places))
            with watching(asked, places, processes.board) as look:
                while not stopped and time.monotonic() < until:
                    time.sleep(_POLL_PERIOD_S)
                    processes.check()
                    look()
        finally:
            processes.stop()
    if terms.as_json:
        _say(summary(asked, processes.board, time.monotonic() - began))
    return 0


def _addresses(asked: Request, terms: Terms) -> list[Address]:
    try:
        more = tuple(extra(text, asked.count) for text in terms.to)
        places = addresses(asked.flavour, asked.count, terms.port_base, terms.host, more)
    except EndpointError as error:
        raise InputError(f"--to {error}") from None
    open_to_all = [str(one) for one in places[0].endpoints if exposed(one)]
    if open_to_all and asked.key is None:
        sys.stderr.write(
            f"outrider sitl: {', '.join(open_to_all)}: reachable from other machines, and everyone there can "
            "command the vehicles; --signing-key FILE restricts this to holders of the key\n"
        )
    return places


def _opened(places: Sequence[Address], clock: Clock) -> list[list[Link]]:
    """Return the links of each vehicle. Raises InputError if one cannot be opened; then none stays open."""
    with ExitStack() as opened:
        every: list[list[Link]] = []
        for address in places:
            links = []
            for endpoint in address.endpoints:
                try:
                    link = open_link(endpoint, clock)
                except LinkError as error:
                    hint = "; is another SITL running? --port-base P puts all ports elsewhere"
                    raise InputError(f"{error}{hint if 'in use' in str(error) else ''}") from None
                opened.callback(link.close)
                links.append(link)
            every.append(links)
        opened.pop_all()
    return every


def _wait(processes: Processes, stopped: Sequence[object], count: int) -> None:
    """Wait until all vehicles are up, or a signal ends the run."""
    while not stopped and not all(processes.board.snapshot(index).up for index in range(count)):
        time.sleep(0.02)
        processes.check()


def _say(value: dict[str, Value]) -> None:
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()
