"""Client of the view process: starts it and exchanges messages with it.

A flight continues if the view process fails.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

from outrider.errors import InputError
from outrider.scene.datagram_channel import DatagramChannel, pair
from outrider.scene.scene import Scene
from outrider.scene.view_commands import ViewCommands
from outrider.view.live import Begin, Landed, Ready, packed

_START_TIMEOUT_S = 60.0
"""Time (s) that the process has to start."""


class ViewerClient:
    """View process that serves at ``host`` and ``port``, or at the next free port.

    ``url`` is the address of the page; ``line`` is this process's end of the channel. Raises InputError if
    the page cannot be served there, ModuleNotFoundError without the extra ``view``.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 8080) -> None:
        import_module("viser")
        self._filed: Path | None = None
        ours, theirs = pair()
        self.line = DatagramChannel(ours)
        command = [sys.executable, "-m", "outrider.view.process", str(theirs.fileno()), host, str(port)]
        # The session is its own, so that Ctrl-C reaches only the flight.
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

    def begin(self, scene: Scene, commands: ViewCommands) -> None:
        """Report that a flight of ``scene`` begins."""
        try:
            data, self._filed = packed(Begin(scene, commands))
        except OSError:
            # No room for the file: the flight must not be affected.
            return
        self.line.send(data)

    def landed(self, directory: Path) -> None:
        """Report that the flight has ended; the view then shows the run in ``directory``."""
        self.line.send(pickle.dumps(Landed(str(directory.resolve()))))

    def wait(self) -> None:
        """Wait until the view ends or Ctrl-C is pressed."""
        try:
            self.process.wait()
        except KeyboardInterrupt:
            return

    def close(self) -> None:
        """End the process, and close the channel."""
        self.process.terminate()
        try:
            self.process.wait(2.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.line.close()
        if self._filed is not None:
            self._filed.unlink(missing_ok=True)

    def _ready(self) -> Ready:
        until = time.monotonic() + _START_TIMEOUT_S
        while time.monotonic() < until and self.process.poll() is None:
            for data in self.line.receive():
                found = pickle.loads(data)
                if isinstance(found, Ready):
                    return found
            time.sleep(0.02)
        return Ready(error="its process ended" if self.process.poll() is not None else "it does not start")
