"""Injection of failures by MAV_CMD_INJECT_FAILURE (420), for tests of their consequences."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from sitl.autopilot.command_protocol import Handler, Order
from sitl.autopilot.firmware import DENIED, UNSUPPORTED, Denial
from sitl.autopilot.plant import Plant
from sitl.config.autopilot import AutopilotConfig
from sitl.vehicle.battery import Battery

INJECT: Final = 420

# FAILURE_UNIT and FAILURE_TYPE
_GPS, _BATTERY, _MOTOR = 4, 100, 101
_OK, _OFF = 0, 1


class Failures:
    """Handler of failure injection, active if the configuration allows it (PX4: SYS_FAILURE_EN).

    GPS and motors can fail and recover, a battery empties at once. Other units and kinds of failure are not
    simulated.
    """

    def __init__(self, plant: Plant, battery: Battery | None, config: Callable[[], AutopilotConfig]) -> None:
        """``config`` returns the present configuration."""
        self._plant = plant
        self._battery = battery
        self._config = config
        self.commands: dict[int, Handler] = {INJECT: self._inject}

    def _inject(self, order: Order) -> Denial | None:
        unit, kind, instance = order.params[:3]
        if self._config().failures == "refused":
            return Denial(DENIED, "Failure refused: injection is off")
        if kind in (_OK, _OFF):
            if unit == _GPS:
                self._gps(off=kind == _OFF)
                return None
            if unit == _MOTOR:
                return self._motor(instance, left=0.0 if kind == _OFF else 1.0)
            if unit == _BATTERY and kind == _OFF and self._battery is not None:
                self._battery.drain()
                return None
        return Denial(UNSUPPORTED, f"Failure refused: unit {unit:.0f}, kind {kind:.0f} is not simulated")

    def _gps(self, *, off: bool) -> None:
        if off:
            self._plant.lose_gps()
        else:
            self._plant.sensors.gps.regain()

    def _motor(self, instance: float, left: float) -> Denial | None:
        """Set the remaining speed of motor ``instance``: 1 is the first motor, 0 all."""
        count = len(self._plant.vehicle.config.rotors)
        if not math.isfinite(instance) or not 0 <= instance <= count:
            return Denial(DENIED, f"Failure refused: there are {count} motors")
        chosen = range(count) if instance == 0 else [int(instance) - 1]
        for index in chosen:
            self._plant.vehicle.fail_rotor(index, left)
        return None
