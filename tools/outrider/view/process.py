"""View as a process of its own: ``python -m outrider.view.process DESCRIPTOR HOST PORT``."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import socket
import sys

from outrider.scene.datagram_channel import DatagramChannel
from outrider.view.live import LiveSource, Ready

_NICE = 10
"""Nice value: flying processes have priority."""


def main(descriptor: int, host: str, port: int) -> None:
    """Serve until the process that started this one ends.

    ``descriptor`` is the file descriptor of the channel's socket.
    """
    parent = os.getppid()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(OSError):
        os.nice(_NICE)
    line = DatagramChannel(socket.socket(fileno=descriptor))
    try:
        from outrider.view.page_server import PageServer
        from outrider.view.player import load

        page_server = PageServer(host, port)
    except Exception as error:
        line.send(pickle.dumps(Ready(error=f"{type(error).__name__}: {error}")))
        return
    line.send(pickle.dumps(Ready(page_server.url)))
    page_server.run(LiveSource(line, load), lambda: os.getppid() != parent)
    # Threads of the server may still be sending to browsers: do not wait for them.
    os._exit(0)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
