"""Flight control of an emulated autopilot: the commander with set-points, failsafes and manoeuvres."""

from __future__ import annotations

from collections.abc import Callable

from sitl.autopilot.commander import Commander
from sitl.autopilot.failsafes import Failsafes
from sitl.autopilot.fences import Fences
from sitl.autopilot.firmware import Firmware
from sitl.autopilot.maneuvers import Maneuvers
from sitl.autopilot.navigation import Navigation
from sitl.autopilot.setpoint_reception import SetpointReception
from sitl.config.autopilot import AutopilotConfig
from sitl.estimation.sensors import Estimate
from sitl.telemetry.status_text import StatusReporter
from sitl.vehicle.battery import Battery


class FlightControl:
    """Parts that decide on arming and modes.

    ``steering`` receives set-points. ``failsafes`` monitors battery and fence, and changes the mode of the
    ``commander``; ``maneuvers`` handles commands such as DO_REPOSITION.
    """

    def __init__(
        self,
        config: AutopilotConfig,
        firmware: Firmware,
        navigation: Navigation,
        estimate: Callable[[], Estimate],
        battery: Battery | None,
        reporter: StatusReporter,
    ) -> None:
        guidance, origin, home = navigation.guidance, navigation.origin, navigation.home
        self.steering = SetpointReception(firmware, guidance, origin, home, reporter)
        self.commander = Commander(
            config, firmware, guidance, self.steering, estimate, home, navigation.modes, reporter
        )
        fences = Fences(navigation.plans, origin, home)
        self.failsafes = Failsafes(firmware, self.commander, fences, battery, estimate, reporter)
        self.commander.doubts = self.failsafes.doubts
        self.maneuvers = Maneuvers(
            self.commander,
            firmware,
            guidance,
            origin,
            home,
            navigation.itinerary,
            navigation.following,
            estimate,
            self.failsafes.say_doubts,
        )
