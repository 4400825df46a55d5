"""Emulated vehicles of a trial of certified separation: an ``outrider sitl`` for each flavour."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from mavlink_bridge.frames import FleetFrame
from outrider.errors import OutriderError
from trials.certified_plan import SPACING, CertifiedPlan
from trials.emulation import free_base

_END_TIMEOUT_S: Final = 20.0


class CertifiedVehicles:
    """Vehicles of ``plan`` that follow set-points as their firmware does, and send to ``receiver``, too.

    Each vehicle has an ``outrider sitl`` of its own, so that its time runs on while others are busy. Raises
    OutriderError if one does not start.
    """

    def __init__(self, plan: CertifiedPlan, receiver: str, directory: Path, signing: Sequence[str]) -> None:
        """Take ``signing``: the options for signed links."""
        origin = plan.origin
        frame = FleetFrame(origin["latitude"], origin["longitude"], origin["altitude"])
        self._processes: list[subprocess.Popen[bytes]] = []
        self._endpoints: dict[int, str] = {}
        for system in plan.systems:
            flavour = plan.flavour_of(system)
            latitude, longitude, altitude = frame.to_geodetic((SPACING * (system - 1), 0.0, 0.0))
            command = [sys.executable, "-m", "outrider", "sitl", "--json", f"--flavour={flavour}"]
            command += [f"--first-id={system}", f"--port-base={free_base(flavour, 1)}", f"--to={receiver}"]
            command += [
                f"--origin={latitude:.9f},{longitude:.9f},{altitude:.3f}",
                "--response=firmware",
                *signing,
            ]
            with (directory / f"sitl-{system}.log").open("wb") as err:
                process = subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=err
                )
            self._processes.append(process)
        for system, process in zip(plan.systems, self._processes, strict=True):
            assert process.stdout is not None
            line = process.stdout.readline()
            if not line:
                self.close()
                raise OutriderError(f"outrider sitl ended: see {directory / f'sitl-{system}.log'}")
            ready: dict[str, Any] = json.loads(line)
            self._endpoints[system] = str(ready["vehicles"][0]["pymavlink"])

    def endpoint(self, system: int) -> str:
        """Return the endpoint for that vehicle's companion."""
        return self._endpoints[system]

    def check(self) -> None:
        """Raise OutriderError if a process has ended."""
        for process in self._processes:
            if process.poll() is not None:
                raise OutriderError(f"outrider sitl ended with status {process.returncode}")

    def close(self) -> None:
        """End the processes."""
        for process in self._processes:
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
        for process in self._processes:
            try:
                process.communicate(timeout=_END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()
