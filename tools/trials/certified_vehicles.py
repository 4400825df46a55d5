"""Vehicles of a trial of certified separation and their observer: emulated, or of real firmware."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.wire.signing import Signing
from outrider.errors import OutriderError
from trials.arrivals import Arrivals
from trials.certified_plan import CertifiedPlan
from trials.emulation import free_base
from trials.separation import Track
from trials.station import listener
from trials.vehicles import Real

Array = NDArray[np.float64]
_END_TIMEOUT_S: Final = 20.0


class PositionObserver(Protocol):
    """Observer of true positions (m, fleet frame), by the times (s since the beginning) of their arrival."""

    @property
    def sockets(self) -> list[int]:
        """File descriptors of which one is readable when something has arrived."""
        ...

    @property
    def latest(self) -> float:
        """Time since the beginning (s)."""
        ...

    def seconds(self, clock: Array) -> Array:
        """Return the times (n,) since the beginning (s) at which the wall clock had the values (n,), µs."""
        ...

    def turn(self) -> None:
        """Process everything that has arrived, and request what is missing."""
        ...

    def place(self, system: int) -> Array | None:
        """Return the last position (3,) m of ``system``; None before the first."""
        ...

    def tracks(self) -> Mapping[int, Track]:
        """Return the tracks of the vehicles that were observed, by system id."""
        ...


class CertifiedVehicles(Protocol):
    """Vehicles of a trial, and their ``observer``."""

    @property
    def observer(self) -> PositionObserver:
        """Observer of the vehicles."""
        ...

    def endpoint(self, system: int) -> str:
        """Return the endpoint for that vehicle's companion."""
        ...

    def check(self) -> None:
        """Raise OutriderError if a vehicle has ended."""
        ...

    def close(self) -> None:
        """End the vehicles that the trial has started."""
        ...


def certified_vehicles(
    plan: CertifiedPlan, fleet: FleetFrame, directory: Path, signing: Signing | None, options: Sequence[str]
) -> CertifiedVehicles:
    """Return the vehicles of ``plan``; their files are in ``directory``.

    ``options``: those of ``outrider sitl`` for links that are signed by ``signing``.
    """
    if plan.autopilots:
        return Real(dict(zip(plan.systems, plan.autopilots, strict=True)), fleet, directory, plan.spacing)
    return EmulatedWithObserver(plan, fleet, directory, signing, options)


class EmulatedWithObserver:
    """Emulated vehicles, judged by their reported positions: true ones, unless the plan has sensors."""

    def __init__(
        self,
        plan: CertifiedPlan,
        fleet: FleetFrame,
        directory: Path,
        signing: Signing | None,
        options: Sequence[str],
    ) -> None:
        with ExitStack() as files:
            receiver, told = listener()
            files.callback(receiver.close)
            self._vehicles = SeparateVehicles(plan, told, directory, options)
            files.callback(self._vehicles.close)
            self.observer = Arrivals(receiver, plan.systems, fleet, signing)
            self._files = files.pop_all()

    def endpoint(self, system: int) -> str:
        """Return the endpoint for that vehicle's companion."""
        return self._vehicles.endpoint(system)

    def check(self) -> None:
        """Raise OutriderError if a process has ended."""
        self._vehicles.check()

    def close(self) -> None:
        """End the processes and close the receiver."""
        self._files.close()


class SeparateVehicles:
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
            latitude, longitude, altitude = frame.to_geodetic((plan.spacing * (system - 1), 0.0, 0.0))
            command = [sys.executable, "-m", "outrider", "sitl", "--json", f"--flavour={flavour}"]
            command += [f"--first-id={system}", f"--port-base={free_base(flavour, 1)}", f"--to={receiver}"]
            command += [
                f"--origin={latitude:.9f},{longitude:.9f},{altitude:.3f}",
                "--response=firmware",
                f"--sensors={plan.sensors}",
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
