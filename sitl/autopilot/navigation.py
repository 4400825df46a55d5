"""Navigation of an emulated autopilot: guidance, home, plans and the modes that fly by themselves."""

from __future__ import annotations

from sitl.autopilot.autonomous_modes import AutonomousModes
from sitl.autopilot.firmware import Firmware
from sitl.autopilot.following import Following
from sitl.autopilot.guidance import Guidance
from sitl.autopilot.missions.itinerary import Itinerary
from sitl.autopilot.missions.plans import Plans
from sitl.autopilot.returning import Returning
from sitl.autopilot.saved import Saved
from sitl.config.autopilot import AutopilotConfig
from sitl.values.home import Home
from sitl.values.origin import Origin


class Navigation:
    """Parts that determine where the vehicle flies.

    ``guidance`` generates the reference. ``itinerary`` flies the mission of ``plans``, ``following`` follows
    a leader; ``modes`` selects among these two and the return to ``home``.
    """

    def __init__(self, config: AutopilotConfig, firmware: Firmware, origin: Origin, saved: Saved) -> None:
        px4 = firmware.bytewise
        self.origin = origin
        self.guidance = Guidance(config)
        self.home = Home(origin)
        self.plans = Plans(saved.plans)
        self.itinerary = Itinerary(
            self.plans, self.guidance, self.home, origin, config, firmware.first_item, px4=px4
        )
        self.following = Following(self.guidance, origin, self.home, config.follow, px4=px4)
        returning = Returning(self.guidance, self.home, config)
        self.modes = AutonomousModes(self.itinerary, returning, self.following, self.guidance)
