"""Starts the process of the view, and speaks with it; whatever becomes of that process, a flight goes on."""

from __future__ import annotations

import pickle
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

from outrider.errors import InputError
from outrider.scene.datagram_channel import Line, pair
from outrider.scene.scene import Scene
from outrider.scene.view_commands import Wishes
from outrider.view.live import Begin, Landed, Ready

_PATIENCE = 60.0
"""s that it has to start."""


class Attendant:
    """A view at ``host``, ``port`` or the next that is free. ``url`` leads there; ``line`` is this end.

    InputError if nothing can be served there, ModuleNotFoundError without the extra ``view``.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 8080) -> None:
        import_module("viser")
        ours, theirs = pair()
        self.line = Line(ours)
        command = [sys.executable, "-m", "outrider.view.process", str(theirs.fileno()), host, str(port)]
        # In a session of its own, so that Ctrl-C is the flight's alone.
        self.process = subprocess.Popen(
            command,
            pass_fds=(theirs.fileno(),),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        theirs.close()
        ready = self._ready()
        if ready.error:
            self.close()
            raise InputError(f"--view: no page at {host}:{port}: {ready.error}")
        self.url = ready.url

    def begin(self, scene: Scene, wishes: Wishes) -> None:
        """A flight of ``scene`` begins."""
        self.line.send(pickle.dumps(Begin(scene, wishes)))

    def landed(self, directory: Path) -> None:
        """It is over; the run is shown from now on."""
        self.line.send(pickle.dumps(Landed(str(directory.resolve()))))

    def wait(self) -> None:
        """Until the view ends, or Ctrl-C."""
        try:
            self.process.wait()
        except KeyboardInterrupt:
            return

    def close(self) -> None:
        """End it."""
        self.process.terminate()
        try:
            self.process.wait(2.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.line.close()

    def _ready(self) -> Ready:
        until = time.monotonic() + _PATIENCE
        while time.monotonic() < until and self.process.poll() is None:
            for data in self.line.receive():
                found = pickle.loads(data)
                if isinstance(found, Ready):
                    return found
            time.sleep(0.02)
        return Ready(error="its process ended" if self.process.poll() is not None else "it does not start")
