"""What an autopilot believes about its own motion. The profile ``truth`` believes what is so."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, Protocol

from mavlink_bridge.messages import Vector
from sitl.origin import Origin
from sitl.setpoints import Pose
from sitl.vehicle import VehicleState


class Estimate(NamedTuple):
    """Position (m) and velocity (m/s) in the own local NED; Euler angles (rad) of the FRD body against it;
    body rates (rad/s, FRD)."""

    position: Vector
    velocity: Vector
    roll: float
    pitch: float
    yaw: float
    body_rates: Vector

    @property
    def pose(self) -> Pose:
        """Where it is and where it looks."""
        return Pose(self.position, self.yaw)


class Sensors(Protocol):
    """From the true state to what is known of it."""

    def estimate(self, now: int, state: VehicleState) -> Estimate:
        """What is believed at ``now`` (µs, never decreasing); asked twice for one instant, the same."""
        ...


class Truth:
    """Sensors without error."""

    def __init__(self, origin: Origin) -> None:
        self._origin = origin

    def estimate(self, now: int, state: VehicleState) -> Estimate:
        """The true state in the own local frame; ``now`` does not matter.

        The tilt between site and local plane (0.16 mrad per km) is left out of roll and pitch.
        """
        del now
        w, x, y, z = state.attitude.tolist()
        p, q, r = state.body_rates.tolist()
        heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) - self._origin.turn
        return Estimate(
            self._origin.position_to_local(state.position),
            self._origin.vector_to_local(state.velocity),
            math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            math.asin(max(-1.0, min(1.0, 2.0 * (w * y - x * z)))),
            math.remainder(heading, math.tau),
            (p, q, r),
        )


def sensors(profile: Literal["truth"], origin: Origin, seed: int) -> Sensors:
    """The sensors of a profile; ``seed`` makes their noise, of which ``truth`` has none."""
    del seed
    match profile:
        case "truth":
            return Truth(origin)
