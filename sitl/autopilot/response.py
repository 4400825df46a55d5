"""Response of a vehicle to set-points: ``exact``, or that of a ``firmware``'s position controller."""

from __future__ import annotations

from typing import Protocol

from mavlink_bridge.messages import Vector
from sitl.autopilot.position_control.airframe import Motion
from sitl.autopilot.position_control.ardupilot import ArduPilotResponse
from sitl.autopilot.position_control.px4 import Px4Response
from sitl.config.autopilot import AutopilotConfig


class Response(Protocol):
    """Position controller of a firmware on an airframe; local NED."""

    @property
    def motion(self) -> Motion:
        """Motion of the vehicle."""

    @property
    def desired(self) -> Motion:
        """Motion of the trajectory that the firmware derives from the set-points.

        The activity after the set-points continues from this motion.
        """

    def configure(self, config: AutopilotConfig) -> None:
        """Use new parameters from now on."""

    def restart(self, position: Vector) -> None:
        """Rest at ``position``, with integrals reset."""

    def relocate(self, position: Vector, velocity: Vector) -> None:
        """Handle a jump of the estimate to ``position`` and ``velocity``, and continue from there."""

    def advance(self, wanted: Motion, dt: float, wind: Vector = ..., drift: Vector = ...) -> None:
        """Advance by ``dt`` seconds towards ``wanted``, which is valid at the end of the step.

        ``wind`` (m/s) is the velocity of the air. The estimated position moves by ``drift`` (m/s) more than
        the velocity indicates.
        """


def response_of(config: AutopilotConfig) -> Response | None:
    """Return the response that the settings name; None for the exact one."""
    if config.response == "exact":
        return None
    return ArduPilotResponse.of(config) if config.flavour == "ardupilot" else Px4Response(config.px4)
