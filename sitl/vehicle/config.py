"""Configuration of a simulated vehicle: typed, checked when loaded, frozen."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from sitl.values.camera import CameraConfig
from sitl.vehicle.allocation import effectiveness
from sitl.vehicle.ground import GRAVITY

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Rotor(BaseModel):
    """Place of a rotor on the body, forward-right-down, and its sense of rotation."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    angle_deg: float = Field(
        ge=-360.0, le=360.0, description="from the nose, clockwise seen from above (deg)"
    )
    arm: Positive = Field(description="horizontal distance from the centre of mass (m)")
    z: float = Field(0.0, ge=-2.0, le=2.0, description="below the centre of mass (m); negative is above")
    spin: Literal["ccw", "cw"] = Field(description="sense of turning, seen from above")

    @property
    def position(self) -> tuple[float, float, float]:
        """Hub in body axes, forward-right-down (m)."""
        angle = math.radians(self.angle_deg)
        return (self.arm * math.cos(angle), self.arm * math.sin(angle), self.z)

    @property
    def spin_sign(self) -> float:
        """+1 for counter-clockwise: its drag torque turns the body to positive yaw."""
        return 1.0 if self.spin == "ccw" else -1.0


class VehicleConfig(BaseModel):
    """Multirotor with rotors of one kind that push the same way, and its geometric controller; or a point.

    Raises ``pydantic.ValidationError`` for rotors that cannot hover, or cannot produce the three moments and
    a thrust independently of each other.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(min_length=1, description="what reports call it")
    mass: Positive = Field(description="kg")
    inertia: tuple[Positive, Positive, Positive] = Field(description="diagonal of J about body axes (kg m²)")
    span: Positive = Field(description="tip-to-tip diameter (m)")
    motion: Literal["multirotor", "point"] = Field(
        "multirotor",
        description="multirotor: rigid body with rotors and controller; point: it is where its reference"
        " says, without physics, for comparisons with planners that assume this",
    )
    point_window_us: int = Field(
        0,
        ge=0,
        le=2_000_000,
        multiple_of=4,
        description="µs over which a point averages its reference; 0: it is exactly there (double"
        " integrator); certified.dt_us: limits.j_max bounds its jerk, and it is half of that"
        " late (triple integrator)",
    )

    rotors: tuple[Rotor, ...] = Field(min_length=4, description="in the order of the motor outputs")
    k_f: Positive = Field(description="thrust over squared rotor speed (N s²/rad²)")
    k_m: Positive = Field(description="drag torque over thrust (m)")
    omega_max: Positive = Field(description="greatest rotor speed (rad/s)")
    omega_idle: Positive = Field(description="rotor speed when armed, and the least in flight (rad/s)")
    tau_up: Positive = Field(description="time constant of a rotor that speeds up (s)")
    tau_down: Positive = Field(description="time constant of a rotor that slows down (s)")
    rotor_drag: NotNegative = Field(description="c in the drag −c|ω|v⊥ of each rotor (kg/rad)")
    rolling_moment: NotNegative = Field(description="c in the moment −c|ω|v⊥ of each rotor (kg m/rad)")

    k_x: Positive = Field(description="position gain (N/m)")
    k_v: Positive = Field(description="velocity gain (N s/m)")
    k_R: tuple[Positive, Positive, Positive] = Field(description="attitude gains (N m)")  # noqa: N815
    k_Omega: tuple[Positive, Positive, Positive] = Field(description="body rate gains (N m s)")  # noqa: N815
    rate_feed_forward: bool = Field(
        True, description="the paper's Ω_c and its derivative; RotorS leaves them out"
    )
    drag_feed_forward: Share = Field(
        1.0, description="part of the hover rotor drag that the controller cancels"
    )
    heading: Literal["euler", "paper"] = Field(
        "euler", description="what yaw means when tilted: the Euler angle, or the paper's b1d"
    )
    max_tilt_deg: Annotated[float, Field(gt=0.0, lt=90.0)] | None = Field(
        45.0, description="greatest tilt that is commanded (deg); null leaves force and thrust unlimited"
    )
    max_yaw_error_deg: Annotated[float, Field(gt=0.0, le=90.0)] | None = Field(
        45.0, description="greatest turn that is commanded at once (deg); null leaves it unlimited"
    )
    disturbance_force_rate: NotNegative = Field(
        0.0, description="how fast an unexplained force is learnt, to be countered (1/s); 0 leaves it out"
    )
    disturbance_moment_rate: NotNegative = Field(
        0.0, description="how fast an unexplained moment is learnt, to be countered (1/s); 0 leaves it out"
    )
    max_disturbance_force: Share = Field(0.5, description="greatest force that is learnt, over weight")
    max_disturbance_moment: tuple[NotNegative, NotNegative, NotNegative] = Field(
        (1.0, 1.0, 0.1), description="greatest moments that are learnt, about body axes (N m)"
    )
    min_lift: Share = Field(0.3, description="least upward force that is commanded, over weight")

    rest_height: NotNegative = Field(description="centre of mass above the ground when landed (m)")
    gear_radius: Positive = Field(description="radius of the landing gear (m)")
    ground_friction: NotNegative = Field(0.6, description="friction coefficient of gear on ground")
    physics_period: int = Field(
        2500, gt=0, le=20_000, multiple_of=4, description="step of physics and controller (µs)"
    )
    camera: CameraConfig | None = Field(None, description="camera that it carries; null: none")

    @model_validator(mode="after")
    def _can_fly(self) -> Self:
        if self.point_window_us and self.motion != "point":
            raise ValueError(
                f"point_window_us {self.point_window_us} needs motion: point; it is {self.motion!r}"
            )
        if self.point_window_us % self.physics_period:
            raise ValueError(
                f"point_window_us {self.point_window_us} must be a multiple of physics_period"
                f" {self.physics_period}"
            )
        if self.omega_idle >= self.omega_max:
            raise ValueError(f"omega_idle {self.omega_idle} must be below omega_max {self.omega_max}")
        lift = len(self.rotors) * self.k_f * self.omega_max**2
        weight = self.mass * GRAVITY
        if lift <= 1.05 * weight:
            raise ValueError(
                f"all rotors lift {lift:.1f} N, less than 1.05 times the weight of {weight:.1f} N"
            )
        x, y, _ = np.array([rotor.position for rotor in self.rotors]).T
        matrix = effectiveness(x, y, np.array([rotor.spin_sign for rotor in self.rotors]), self.k_m)
        if np.linalg.matrix_rank(matrix, tol=1e-6 * self.k_m) < 4:
            raise ValueError("the rotors cannot make thrust, roll, pitch and yaw independently of each other")
        if np.any(np.linalg.pinv(matrix)[:, 0] <= 0.0):
            raise ValueError("a rotor would have to pull down in hover")
        return self
