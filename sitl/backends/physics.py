"""What an autopilot needs of a vehicle in its air, whoever works out how it moves."""

from __future__ import annotations

from typing import Literal, Protocol

from numpy.typing import ArrayLike

from mavlink_bridge.messages import Vector
from sitl.vehicle.airframe import FloatArray
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Reference, VehicleState

PhysicsName = Literal["own", "jsbsim"]


class BackendError(RuntimeError):
    """A physics engine that cannot be used, or has failed in flight."""


class Physics(Protocol):
    """One vehicle with its controller over its ground, in the site's NED frame."""

    @property
    def config(self) -> VehicleConfig:
        """What the vehicle is made of."""

    def advance(
        self, steps: int, reference: Reference | None, wind: ArrayLike = ..., *, idle: bool = False
    ) -> FloatArray:
        """Advance by ``steps`` physics steps; the true positions (steps, 3) (m, NED) after each of them.

        The reference holds for the beginning of the first step. None stops the motors, or with ``idle``
        leaves them turning slowly. ``wind`` (3,) is the velocity of the air (m/s, NED). Raises
        NotFiniteError for what is not finite, having moved nothing, and BackendError.
        """

    def fail_rotor(self, index: int, left: float) -> None:
        """From now on the rotor ``index`` (0…n−1) turns at the part ``left`` (0…1) of its motor's speed;
        nothing tells the controller. Raises IndexError and ValueError."""

    @property
    def state(self) -> VehicleState:
        """The true state after the last step; own copies."""

    @property
    def on_ground(self) -> bool:
        """Whether the vehicle stands on the ground after the last step."""

    @property
    def air(self) -> Vector:
        """Velocity of the air (m/s, NED) around the vehicle in the last step."""
