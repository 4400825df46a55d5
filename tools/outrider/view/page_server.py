"""Page server: serves the page on this machine, with the data of a source."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable

import viser

from outrider.scene.scene import Scene
from outrider.scene.snapshot import Snapshot
from outrider.view import camera
from outrider.view.origin_check import guarded
from outrider.view.panel import Panel
from outrider.view.renderer import Renderer
from outrider.view.source import Source

PICTURE = 1.0 / 30.0
"""Shortest time (s) between two pictures."""
_COMMAND_PERIOD_S = 0.3
"""Period (s) at which view commands are repeated."""


class Server(viser.ViserServer):
    """Viser's server, without connections to other machines."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Return None: there is no share URL."""
        return None


class PageServer:
    """Page at ``host`` and ``port``, or at the next free port. ``url`` is its address."""

    def __init__(self, host: str, port: int) -> None:
        self._stage: Renderer | None = None
        self._panel: Panel | None = None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            with guarded(host, lambda: "" if self._stage is None else self._stage.scene.title):
                self.server = Server(host=host, port=port, verbose=False)
        here = "localhost" if host in ("127.0.0.1", "0.0.0.0", "::", "::1") else host
        self.url = f"http://{here}:{self.server.get_port()}"
        self.server.gui.add_markdown("No data has been received yet.")
        self.server.on_client_connect(self._connected)

    def run(self, source: Source, over: Callable[[], bool]) -> None:
        """Show ``source`` and pass view commands to it until ``over`` returns true."""
        said, last_commands = 0.0, None
        while not over():
            wall = time.monotonic()
            self.show(source, wall)
            panel = self._panel
            if panel is not None:
                if source.span is None:
                    panel.watch(bool(self.server.get_clients()))
                sought, panel.sought = panel.sought, None
                if panel.commands != last_commands:
                    panel.head()
                if sought is not None or panel.commands != last_commands or wall - said > _COMMAND_PERIOD_S:
                    said, last_commands = wall, panel.commands
                    source.command(panel.commands, sought)
            time.sleep(max(PICTURE - (time.monotonic() - wall), 0.005))

    def show(self, source: Source, wall: float) -> None:
        """Show the new data of ``source`` at the wall time ``wall`` (s)."""
        moments: list[Snapshot] = []
        for one in source.poll(wall):
            if isinstance(one, Scene):
                self._set(one, source)
                moments.clear()
            else:
                moments.append(one)
        stage, panel = self._stage, self._panel
        if stage is None or panel is None or not moments:
            return
        *past, last = moments
        with self.server.atomic():
            stage.show(last, tuple(past))
            for moment in moments:
                panel.see(moment)
            panel.notice(last)
            panel.show(last, wall, last.time if source.span is not None else None)

    def _set(self, scene: Scene, source: Source) -> None:
        self.server.scene.reset()
        self.server.gui.reset()
        self._stage = Renderer(self.server, scene)
        for client in self.server.get_clients().values():
            self._connected(client)
        self._panel = Panel(self.server, self._stage, source.begin, source.span, source.hint)

    def _connected(self, client: viser.ClientHandle) -> None:
        """Show the whole scene also in a picture that is higher than wide: the first camera is for all."""
        if self._stage is not None and client.camera.aspect < 1.0:
            camera.whole(client.camera, self._stage.scene.reach, client.camera.aspect)

    def stop(self) -> None:
        """Stop the server."""
        self.server.stop()
