"""Interface of the physics of a vehicle in its air, as required by an autopilot."""

from __future__ import annotations

from typing import Literal, Protocol

from numpy.typing import ArrayLike

from mavlink_bridge.messages import Vector
from sitl.vehicle.airframe import FloatArray
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.multirotor import Reference, VehicleState

PhysicsName = Literal["own", "jsbsim"]


class BackendError(RuntimeError):
    """Failure of a physics engine, in flight or before it can be used."""


class Physics(Protocol):
    """One vehicle with its controller over its ground, in site NED (``sitl.values.origin``)."""

    @property
    def config(self) -> VehicleConfig:
        """Configuration of the vehicle."""

    def advance(
        self, steps: int, reference: Reference | None, wind: ArrayLike = ..., *, idle: bool = False
    ) -> FloatArray:
        """Advance by ``steps`` physics steps; return the true positions (steps, 3) (m, NED) after each.

        The reference is valid at the beginning of the first step. None stops the motors, or with ``idle``
        lets them turn slowly. ``wind`` (3,) is the velocity of the air (m/s, NED). Raises NotFiniteError for
        inputs that are not finite, before anything has moved, and BackendError.
        """

    def fail_rotor(self, index: int, left: float) -> None:
        """Limit the rotor ``index`` (0…n−1) to the fraction ``left`` (0…1) of its motor's speed from now on.

        The controller receives no indication. Raises IndexError and ValueError.
        """

    @property
    def state(self) -> VehicleState:
        """True state after the last step, in arrays that later steps do not change."""

    @property
    def on_ground(self) -> bool:
        """Whether the vehicle stands on the ground after the last step."""

    @property
    def air(self) -> Vector:
        """Velocity of the air (m/s, NED) around the vehicle in the last step."""
