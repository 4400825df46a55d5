"""Where a vehicle is that is sent set-points: at them (``exact``), or where a ``firmware`` flies it."""

from __future__ import annotations

from typing import Protocol

from mavlink_bridge.messages import Vector
from sitl.autopilot.position_control.airframe import Motion
from sitl.autopilot.position_control.ardupilot import ArduPilotResponse
from sitl.autopilot.position_control.px4 import Px4Response
from sitl.config.autopilot import AutopilotConfig


class Response(Protocol):
    """A firmware's position controller on an airframe; local NED."""

    @property
    def motion(self) -> Motion:
        """The vehicle's."""

    @property
    def desired(self) -> Motion:
        """That of the trajectory that the firmware makes of the set-points; when they end it goes on from
        there."""

    def configure(self, config: AutopilotConfig) -> None:
        """Other parameters from now on."""

    def restart(self, position: Vector) -> None:
        """Rest at ``position``, with nothing learnt."""

    def relocate(self, position: Vector, velocity: Vector) -> None:
        """The estimate has jumped: the vehicle is here, and goes on from here."""

    def advance(self, wanted: Motion, dt: float, wind: Vector = ..., drift: Vector = ...) -> None:
        """Move by ``dt`` seconds after ``wanted``, which is valid at the end of them, in air that moves with
        ``wind`` (m/s). The estimated position moves by ``drift`` (m/s) more than the velocity says."""


def response_of(config: AutopilotConfig) -> Response | None:
    """The response that the settings name; None for the exact one."""
    if config.response == "exact":
        return None
    return ArduPilotResponse.of(config) if config.flavour == "ardupilot" else Px4Response(config.px4)
