"""Injection of failures by MAV_CMD_INJECT_FAILURE (420), for tests of their consequences."""

from __future__ import annotations

from collections.abc import Callable

from pymavlink.dialects.v20 import all as mavlink

from sitl.autopilot.command_protocol import Handler, Order
from sitl.autopilot.firmware import CommandRefusal
from sitl.autopilot.plant import Plant
from sitl.config.autopilot import AutopilotConfig
from sitl.vehicle.battery import Battery


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
        self.commands: dict[int, Handler] = {mavlink.MAV_CMD_INJECT_FAILURE: self._inject}

    def _inject(self, order: Order) -> CommandRefusal | None:
        unit, kind, instance = order.params[:3]
        if self._config().failures == "refused":
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Failure refused: injection is off")
        off = kind == mavlink.FAILURE_TYPE_OFF
        if off or kind == mavlink.FAILURE_TYPE_OK:
            if unit == mavlink.FAILURE_UNIT_SENSOR_GPS:
                self._gps(off=off)
                return None
            if unit == mavlink.FAILURE_UNIT_SYSTEM_MOTOR:
                return self._motor(instance, left=0.0 if off else 1.0)
            if unit == mavlink.FAILURE_UNIT_SYSTEM_BATTERY and off and self._battery is not None:
                self._battery.drain()
                return None
        reason = f"Failure refused: unit {unit:.0f}, kind {kind:.0f} is not simulated"
        return CommandRefusal(mavlink.MAV_RESULT_UNSUPPORTED, reason)

    def _gps(self, *, off: bool) -> None:
        if off:
            self._plant.lose_gps()
        else:
            self._plant.sensors.gps.regain()

    def _motor(self, instance: float, left: float) -> CommandRefusal | None:
        """Limit motor ``instance`` (1: the first, 0: all) to the fraction ``left`` (0…1) of its speed."""
        config = self._plant.vehicle.config
        if config.motion == "point":
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Failure refused: a point has no motors")
        count = len(config.rotors)
        if not instance.is_integer() or not 0 <= instance <= count:
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, f"Failure refused: there are {count} motors")
        chosen = range(count) if instance == 0 else [int(instance) - 1]
        for index in chosen:
            self._plant.vehicle.fail_rotor(index, left)
        return None
