"""Vehicles of a trial with their observer: emulated ones, or those of real firmware."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Protocol

from mavlink_bridge.frames import FleetFrame
from trials.autopilots import Autopilot, Program, Running
from trials.emulation import Emulation
from trials.firmware import Firmware
from trials.observer import Observer, SitlObserver
from trials.plan import ROW, Plan
from trials.receivers import open_receivers
from trials.station import listener
from trials.truth import TruthObserver


class Vehicles(Protocol):
    """Vehicles of a trial, and their ``observer``."""

    @property
    def observer(self) -> Observer:
        """Observer of the vehicles."""
        ...

    @property
    def summary(self) -> dict[str, Any]:
        """Summary that the vehicles gave at the end."""
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


class Emulated:
    """Vehicles of ``outrider sitl``."""

    def __init__(self, plan: Plan, fleet: FleetFrame, directory: Path) -> None:
        with ExitStack() as files:
            receiver, told = listener()
            files.callback(receiver.close)
            self._emulation = Emulation(plan, told, directory)
            files.callback(self._emulation.close)
            self.observer: Observer = SitlObserver(receiver, plan.systems, fleet)
            self._files = files.pop_all()

    @property
    def summary(self) -> dict[str, Any]:
        """Summary of ``outrider sitl``."""
        return self._emulation.summary

    def endpoint(self, system: int) -> str:
        """Return the endpoint for that vehicle's companion."""
        return self._emulation.endpoint(system)

    def check(self) -> None:
        """Raise OutriderError if the process has ended."""
        self._emulation.check()

    def close(self) -> None:
        """End the process and close the receiver."""
        self._files.close()


class Real:
    """Vehicles of real firmware's simulations, started here or already running."""

    def __init__(
        self, flown: Mapping[int, Autopilot], fleet: FleetFrame, directory: Path, row: float = ROW
    ) -> None:
        """Start those of ``flown``, by system id, that are programs, ``row`` metres apart."""
        programs = {system: one for system, one in flown.items() if isinstance(one, Program)}
        running = {system: one for system, one in flown.items() if isinstance(one, Running)}
        with ExitStack() as files:
            self._firmware = Firmware(programs, fleet, directory, row)
            files.callback(self._firmware.close)
            launches = self._firmware.launches
            self._endpoints = {
                **{system: one.endpoint for system, one in launches.items()},
                **{system: one.endpoint for system, one in running.items()},
            }
            told = {
                **{system: one.told for system, one in launches.items()},
                **{system: one.told for system, one in running.items()},
            }
            receivers = open_receivers(told)
            for receiver in receivers.values():
                files.callback(receiver.close)
            flavours = {system: one.flavour for system, one in flown.items()}
            self.observer = TruthObserver(receivers, flavours, fleet)
            self._files = files.pop_all()

    @property
    def summary(self) -> dict[str, Any]:
        """Empty: they give no summary."""
        return {}

    def endpoint(self, system: int) -> str:
        """Return the endpoint for that vehicle's companion."""
        return self._endpoints[system]

    def check(self) -> None:
        """Raise OutriderError if a simulation that was started here has ended."""
        self._firmware.check()

    def close(self) -> None:
        """End the simulations that were started here, and close the receivers."""
        self._files.close()


def vehicles(plan: Plan, fleet: FleetFrame, directory: Path) -> Vehicles:
    """Return the vehicles of ``plan``; their files are in ``directory``."""
    if not plan.autopilots:
        return Emulated(plan, fleet, directory)
    return Real(dict(zip(plan.systems, plan.autopilots, strict=True)), fleet, directory)
