"""Command ``outrider view``: plays a run, writes it as one file, or shows vehicles from their messages."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.errors import EndpointError, LinkError, LogError
from mavlink_bridge.links.endpoints import Endpoint, Multicast, UdpIn, UdpOut, parse_endpoint
from mavlink_bridge.links.opening import open_link
from outrider.errors import InputError
from outrider.interruption import noted
from outrider.scenarios.scenario import TARGET_SYSTEM
from outrider.terminal.share_progress import share_progress
from outrider.view.listener import Listener
from outrider.view.missing_peers import MissingPeers
from outrider.view.page_document import recorded_page
from outrider.view.page_server import PageServer
from outrider.view.player import Player, load
from outrider.view.renderer import Renderer
from outrider.view.source import Source

_ALLOWED: Final = (
    "allowed: a run directory, or endpoints that are listened to: udpin:HOST:PORT, mcast:, tcp:HOST:PORT, "
    "/dev/DEVICE,BAUD, tlog:PATH"
)
_PICTURE_PERIOD_S: Final = 0.1
"""Time between two pictures of a recording (s)."""


class Terms(NamedTuple):
    """Options of the view. ``seconds`` is the wall time after which it ends by itself."""

    host: str = "127.0.0.1"
    port: int = 8080
    target: int = TARGET_SYSTEM
    html: Path | None = None
    seconds: float | None = None


def view(sources: Sequence[str], terms: Terms) -> int:
    """Show ``sources`` until Ctrl-C, SIGTERM or the end of the time, and return the exit status.

    With ``terms.html``, write the run to that file instead. Raises InputError if the sources cannot be shown.
    """
    if len(sources) == 1 and ":" not in sources[0] and not sources[0].startswith("/dev/"):
        with share_progress() as watch:
            player = load(Path(sources[0]), watch)
        if terms.html is not None:
            return _write(player, terms.html)
        return _serve(player, terms, "plays")
    if terms.html is not None:
        raise InputError(
            f"--html {terms.html}: only a finished run can be written to a file; allowed: a run directory"
        )
    with ExitStack() as opened:
        listener, missing = _listening(sources, terms, opened)
        return _serve(listener, terms, "listens, and sends nothing:", missing.say)


def _listening(sources: Sequence[str], terms: Terms, opened: ExitStack) -> tuple[Listener, MissingPeers]:
    clock = WallClock()
    places, links = [], []
    for text in sources:
        try:
            place = parse_endpoint(text)
            if isinstance(place, UdpOut) or (isinstance(place, UdpIn) and place.peer is not None):
                raise InputError(f"view {text}: a view sends nothing; {_ALLOWED}")
            link = open_link(place, clock)
        except EndpointError as error:
            raise InputError(f"view {error}" if ":" in text else f"view {text}: {_ALLOWED}") from None
        except (LinkError, LogError) as error:
            raise InputError(f"view {error}") from None
        opened.callback(link.close)
        places.append(place)
        links.append(link)
    hint = f"Listening at {', '.join(map(str, places))}; nothing is sent. (ArduPilot waits for requests.)"
    listener = Listener(links, [_whole(place) for place in places], terms.target, hint)
    return listener, MissingPeers(places, links)


def _whole(place: Endpoint) -> bool:
    return isinstance(place, UdpIn | Multicast)


def _serve(source: Source, terms: Terms, does: str, each_time: Callable[[], None] = lambda: None) -> int:
    """Serve the page of ``source``; ``each_time`` is called once for each picture."""
    with _quiet(), noted((signal.SIGINT, signal.SIGTERM)) as stopped:
        try:
            page_server = PageServer(terms.host, terms.port)
        except OSError as error:
            raise InputError(f"--host {terms.host}, --port {terms.port}: {error.strerror or error}") from None
        sys.stderr.write(f"outrider view {does} {page_server.url} shows it; Ctrl-C ends it\n")
        until = None if terms.seconds is None else time.monotonic() + terms.seconds

        def over() -> bool:
            each_time()
            return bool(stopped) or (until is not None and time.monotonic() > until)

        page_server.run(source, over)
        page_server.stop()
    return 0


def _write(player: Player, path: Path) -> int:
    """Write the run as one HTML file and return the exit status.

    Raises InputError if the file exists or its directory does not.
    """
    if path.exists():
        raise InputError(f"--html {path}: is there already; allowed: a new file")
    if not path.parent.is_dir():
        raise InputError(f"--html {path}: there is no directory {path.parent}")
    with _quiet(), share_progress() as watch:
        text = _html(player, watch)
    path.write_text(text, encoding="utf-8")
    sys.stdout.write(f"{path}\n")
    return 0


def _html(player: Player, watch: Callable[[str, float], None]) -> str:
    """Return the HTML of the whole run of ``player``, at its own speed, without the table and the plot.

    It plays in any browser without a network.
    """
    page_server = PageServer("127.0.0.1", 0)
    try:
        stage = Renderer(page_server.server, player.scene)
        begin, end = player.span
        stage.show(player.moment(begin))
        recording = page_server.server.get_scene_serializer()
        for at in np.arange(begin, end, _PICTURE_PERIOD_S).tolist():
            stage.show(player.moment(at))
            recording.insert_sleep(_PICTURE_PERIOD_S)
            watch("drawing", (at - begin) / max(end - begin, _PICTURE_PERIOD_S))
        return recorded_page(recording.as_html(), player.scene.title)
    finally:
        page_server.stop()


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Discard standard output, which is for scripts; the server would print there that it stopped."""
    with open(os.devnull, "w", encoding="utf-8") as nowhere, contextlib.redirect_stdout(nowhere):
        yield
