"""``--view``: a flight of ``outrider swarm`` with a live view."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from outrider.realtime.view import RealTimeView
from outrider.scene.airframe import airframe_of
from outrider.scene.changes import Orders
from outrider.scene.scene import Lever, staged
from outrider.scene.view_commands import ViewCommands
from outrider.swarm.lockstep_view import LockStepView
from outrider.view.viewer_client import ViewerClient

if TYPE_CHECKING:
    from outrider.simulation.preparation import Prepared

_CHANGES: frozenset[Lever] = frozenset({"methods", "loss", "target"})


class FlightView:
    """View of one flight by ``viewer``.

    ``watched``: whether a user is at a terminal; then a lock-step flight runs in real time from the
    beginning.
    """

    def __init__(self, viewer: ViewerClient, watched: bool) -> None:
        self._viewer, self._watched = viewer, watched
        self.orders = Orders()

    def lock_step(self, prepared: Prepared, seed: int) -> LockStepView:
        """Return the onlooker of a lock-step flight."""
        self._begin(prepared, seed, _CHANGES | {"pace"}, ViewCommands(speed=1.0 if self._watched else None))
        view = LockStepView(self._viewer.line)
        self.orders = view.orders
        return view

    def real_time(self, prepared: Prepared, seed: int) -> RealTimeView:
        """Return the view of a flight in real time."""
        self._begin(prepared, seed, _CHANGES, ViewCommands())
        view = RealTimeView(self._viewer.line)
        self.orders = view.orders
        return view

    def stay(self, directory: Path) -> None:
        """After the flight, play the run in ``directory`` until Ctrl-C if a user is at a terminal."""
        if self.orders.given:
            sys.stderr.write(f"changed by hand {len(self.orders.given)} times: {directory / 'orders.json'}\n")
        if self._watched:
            self._viewer.landed(directory)
            sys.stderr.write(f"{self._viewer.url} plays the run; Ctrl-C ends it\n")
            self._viewer.wait()

    def _begin(self, prepared: Prepared, seed: int, levers: frozenset[Lever], commands: ViewCommands) -> None:
        scene = staged(prepared.scenario, seed, airframe_of(prepared.vehicle), levers)
        self._viewer.begin(scene, commands)


@contextmanager
def showing() -> Iterator[FlightView]:
    """Open a view on this machine, and close it afterwards.

    Raises InputError if the page cannot be served, ModuleNotFoundError without the extra ``view``.
    """
    viewer = ViewerClient()
    try:
        sys.stderr.write(f"{viewer.url} shows the flight\n")
        yield FlightView(viewer, sys.stderr.isatty() and sys.stdin.isatty())
    finally:
        viewer.close()
