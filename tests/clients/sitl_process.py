"""``outrider sitl`` as people start it: a process of its own, on ports that nobody else has."""

from __future__ import annotations

import json
import random
import socket
import subprocess
import sys
import threading
from collections.abc import Iterable
from typing import Any, Final

PATIENCE: Final = 120.0
"""s until its vehicles are up: the first start on a machine compiles them."""
# Below the ports that systems hand out by themselves.
_PORTS: Final = range(16_000, 28_000)


class Sitl:
    """Vehicles of one flavour, from ``start`` until the end of the context; ``shared``: a UDP port of this
    machine to which all of them speak as well. ``base`` is known before they are up; ``options`` are more of
    the command."""

    def __init__(
        self, flavour: str, count: int, *, speedup: float = 1.0, options: tuple[str, ...] = ()
    ) -> None:
        self.flavour, self.count, self.speedup, self.options = flavour, count, speedup, options
        self.base, self.shared = _free_ports(flavour, count)
        self.vehicles: list[dict[str, Any]] = []
        self._process: subprocess.Popen[str] | None = None

    def start(self) -> Sitl:
        """Returns when all vehicles are up. Fails with what it said."""
        command = [sys.executable, "-m", "outrider", "sitl", "--json", f"--flavour={self.flavour}"]
        command += [
            f"--count={self.count}",
            f"--speedup={self.speedup}",
            f"--port-base={self.base}",
            *self.options,
        ]
        if self.flavour == "ardupilot":
            command.append(f"--to=udpout:127.0.0.1:{self.shared}")
        self._process = process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert process.stdout is not None
        late = threading.Timer(PATIENCE, process.kill)
        late.start()
        line = process.stdout.readline()
        late.cancel()
        if not line:
            said = process.communicate()[1]
            raise RuntimeError(f"outrider sitl ended with status {process.returncode}: {said}")
        self.vehicles = json.loads(line)["vehicles"]
        return self

    def url(self, index: int) -> str:
        """MAVSDK's for one vehicle; valid before ``start``."""
        if self.flavour == "ardupilot":
            return f"tcpout://127.0.0.1:{self.base + 10 * index}"
        return f"udpin://127.0.0.1:{self.base + index}"

    def endpoint(self, index: int) -> str:
        """pymavlink's and MAVProxy's for one vehicle; valid before ``start``."""
        if self.flavour == "ardupilot":
            return f"tcp:127.0.0.1:{self.base + 10 * index}"
        return f"udpin:127.0.0.1:{self.base + index}"

    def stop(self) -> dict[str, Any]:
        """As Ctrl-C does, and its summary."""
        assert self._process is not None
        self._process.terminate()
        said, errors = self._process.communicate(timeout=PATIENCE)
        assert self._process.returncode == 0, errors
        summary: dict[str, Any] = json.loads(said)
        return summary

    def __enter__(self) -> Sitl:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            self._process.communicate(timeout=PATIENCE)


def _free_ports(flavour: str, count: int) -> tuple[int, int]:
    """A base for ``--port-base``, and the port that all vehicles share."""
    for _ in range(1000):
        base = random.choice(_PORTS)
        if flavour == "ardupilot":
            shared = base + 1
            own = [base + 10 * index + serial for index in range(count) for serial in (0, 2, 3)]
            if _free(socket.SOCK_STREAM, own) and _free(socket.SOCK_DGRAM, [shared]):
                return base, shared
        else:
            shared = base + 10
            own = [base + offset + index for index in range(count) for offset in (0, 40, 4030)]
            if _free(socket.SOCK_DGRAM, [shared, *own]):
                return base, shared
    raise RuntimeError("no free ports")


def _free(kind: socket.SocketKind, ports: Iterable[int]) -> bool:
    try:
        for port in ports:
            with socket.socket(socket.AF_INET, kind) as probe:
                probe.bind(("127.0.0.1", port))
    except OSError:
        return False
    return True


def free_port() -> int:
    """A TCP port that nobody has at the moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
