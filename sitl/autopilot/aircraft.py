"""Aircraft: the vehicle with all that flies it, from the firmware's rules to the battery."""

from __future__ import annotations

from typing import Final

from mavlink_bridge.frames import FleetFrame
from sitl.autopilot.firmware import Firmware
from sitl.autopilot.firmware.ardupilot import ArduPilot
from sitl.autopilot.firmware.px4 import Px4
from sitl.autopilot.flight_control import FlightControl
from sitl.autopilot.navigation import Navigation
from sitl.autopilot.own_clock import OwnClock
from sitl.autopilot.plant import Plant
from sitl.autopilot.saved import Saved
from sitl.config.autopilot import AutopilotConfig
from sitl.environment.weather import WeatherConfig
from sitl.telemetry.status_text import StatusReporter
from sitl.values.origin import Origin
from sitl.vehicle.airframe import hover_speeds
from sitl.vehicle.battery import Battery
from sitl.vehicle.config import VehicleConfig

_FIRMWARE: Final[dict[str, type[ArduPilot] | type[Px4]]] = {"ardupilot": ArduPilot, "px4": Px4}


class Aircraft:
    """Vehicle that flies by itself; it receives and sends no messages. Times are µs since boot.

    ``plant`` moves it as ``navigation`` says, and ``control`` decides on arming and modes by the rules of the
    ``firmware``. ``origin`` is that of its local frame, ``clock`` is that of its autopilot, and ``battery``
    is None if none is simulated.
    """

    def __init__(
        self,
        config: AutopilotConfig,
        vehicle: VehicleConfig,
        site: FleetFrame,
        seed: int,
        weather: WeatherConfig,
        saved: Saved,
        reporter: StatusReporter,
    ) -> None:
        """Start at rest at the configured place, or in flight above it; arguments as of ``Autopilot``."""
        self.firmware: Firmware = _FIRMWARE[config.flavour](config)
        self.origin = Origin(site, config.latitude, config.longitude, config.altitude)
        self.navigation = Navigation(config, self.firmware, self.origin, saved)
        self.plant = Plant(
            config, vehicle, weather, self.navigation.guidance, self.origin, self.firmware.coasting, seed
        )
        self.battery = (
            None if config.battery is None else Battery(config.battery, hover_speeds(vehicle).tolist())
        )
        self.control = FlightControl(
            config, self.firmware, self.navigation, self.plant.estimate, self.battery, reporter
        )
        self.clock = OwnClock(config)
        if config.start_height:
            self.control.commander.begin_in_air()

    def configure(self, config: AutopilotConfig) -> None:
        """Use new settings from now on."""
        navigation = self.navigation
        for part in (self.firmware, navigation.guidance, self.control.commander, navigation.modes):
            part.configure(config)

    def move(self, now: int) -> None:
        """Move until ``now`` and handle the effects on arming, mode and clock."""
        plant, commander = self.plant, self.control.commander
        plant.move(now, armed=commander.armed)
        gps = plant.sensors.gps
        commander.watch(now, plant.vehicle.on_ground, gps.located)
        if commander.ready and gps.fixed:
            self.clock.locate(now)

    def check(self, now: int) -> None:
        """Discharge the battery until ``now`` and run the failsafes, if they are due."""
        if self.battery is not None and self.battery.due(now):
            self.battery.advance(now, self.plant.state.rotor_speeds.tolist())
        if now >= self.control.failsafes.next_due:
            self.control.failsafes.watch(now)
