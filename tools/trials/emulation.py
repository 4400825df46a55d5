"""Running ``outrider sitl`` process."""

from __future__ import annotations

import json
import random
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

from outrider.errors import OutriderError
from trials.plan import HOST, ROW, SORTIE, Plan

_OFFSETS = {"ardupilot": (0, 2, 3), "px4": (0, 10, 40, 4030)}
_STEPS = {"ardupilot": 10, "px4": 1}
_FAREWELL = 20.0


class Emulation:
    """Vehicles of ``plan``, which also send all telemetry to the endpoint ``receiver``.

    Raises OutriderError if they do not start.
    """

    def __init__(self, plan: Plan, receiver: str, directory: Path) -> None:
        count = len(plan.systems)
        base = free_base(plan.flavour, count)
        command = [sys.executable, "-m", "outrider", "sitl", "--json", f"--count={count}"]
        command += [f"--flavour={plan.flavour}", f"--speedup={plan.speed}", f"--port-base={base}"]
        if plan.story == SORTIE:
            command += [f"--columns={count}", f"--spacing={ROW}"]
        if plan.origin is not None:
            place = plan.origin
            command.append(f"--origin={place.latitude},{place.longitude},{place.altitude}")
        with (directory / "sitl.log").open("wb") as err:
            self._process = subprocess.Popen(
                [*command, f"--to={receiver}"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=err
            )
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise OutriderError(f"outrider sitl ended: see {directory / 'sitl.log'}")
        self._ready: dict[str, Any] = json.loads(line)
        self.summary: dict[str, Any] = {}

    def endpoint(self, system: int) -> str:
        """Return the endpoint for that vehicle's companion."""
        return next(str(one["pymavlink"]) for one in self._ready["vehicles"] if one["system_id"] == system)

    def check(self) -> None:
        """Raise OutriderError if the process has ended."""
        if self._process.poll() is not None:
            raise OutriderError(f"outrider sitl ended with status {self._process.returncode}")

    def close(self) -> None:
        """End the process; ``summary`` is then the JSON object that it printed."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
        try:
            out, _ = self._process.communicate(timeout=_FAREWELL)
        except subprocess.TimeoutExpired:
            self._process.kill()
            out, _ = self._process.communicate()
        if out.strip():
            self.summary = json.loads(out)


def free_base(flavour: str, count: int) -> int:
    """Return a base port from which all ports of the SITL are free."""
    kind = socket.SOCK_STREAM if flavour == "ardupilot" else socket.SOCK_DGRAM
    ports = [offset + _STEPS[flavour] * k for offset in _OFFSETS[flavour] for k in range(count)]
    while True:
        base = random.randrange(16_000, 28_000)
        try:
            for port in set(ports):
                with socket.socket(socket.AF_INET, kind) as probe:
                    probe.bind((HOST, base + port))
        except OSError:
            continue
        return base
