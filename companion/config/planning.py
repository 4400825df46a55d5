"""Settings of the planner: horizon, cost, limits, field, methods and heading."""

from __future__ import annotations

import math
from collections.abc import Callable
from numbers import Real
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from companion.values.settings import Positive, Settings, WireStep

Sine = Annotated[float, Field(ge=0.0, le=1.0)]

MethodName = Literal["baseline", "swivel", "approach_angle", "tangential"]


TurningSense = Literal["own", "right", "left"]


Triple = tuple[float, float, float]


Bound = Annotated[float, Field(gt=0.0, le=100.0)]


def _of_each_axis(value: object) -> object:
    """Return three times a number, a list as a tuple, and everything else as it is."""
    if isinstance(value, Real) and not isinstance(value, bool):
        number = float(value)
        return number, number, number
    # A strict model takes no list from a function, although it takes one from JSON.
    return tuple(value) if isinstance(value, list) else value


Bounds = Annotated[
    tuple[Bound, Bound, Bound],
    BeforeValidator(_of_each_axis, json_schema_input_type=Bound | tuple[Bound, Bound, Bound]),
]
"""Bounds of the three axes, east, north and up; one number is that of each."""


NEAREST_FLOOR = -0.1
"""No least value of an axis is nearer to 0."""


Floor = Annotated[float, Field(ge=-100.0, le=NEAREST_FLOOR)]


Floors = Annotated[
    tuple[Floor, Floor, Floor],
    BeforeValidator(_of_each_axis, json_schema_input_type=Floor | tuple[Floor, Floor, Floor]),
]
"""Least values of the three axes, −0.1 at most; one number is that of each.

Committed plans keep 0.01 m/s² from bounds of acceleration, for rounding: an axis needs more than that.
"""


class HorizonConfig(Settings):
    """Horizon of N steps of dt, with N + 1 inputs u(0)…u(N)."""

    steps: int = Field(15, ge=2, le=15, description="N; at most 15, so that a plan fits one TUNNEL message")
    dt_us: WireStep = Field(100_000, description="prediction step, µs; not the replan period")


class CostConfig(Settings):
    """Weights Ω_t and Ω_i, of which only the ratios matter.

    The paper gives no values: these were determined in flights of the swap and the escort.
    """

    omega_t_position: Positive = Field(
        100.0, description="Ω_t: weight of the distance from the destination at the end of the horizon (1/m²)"
    )
    omega_t_velocity: Positive = Field(
        40.0, description="weight of the velocity's error at the end of the horizon (s²/m²)"
    )
    omega_i: Positive = Field(0.5, description="Ω_i: weight of each acceleration of the plan (s⁴/m²)")


class LimitsConfig(Settings):
    """Limits of plans.

    On each axis u and v have a least and a largest value; without ``u_min`` and ``v_min`` both directions
    have the same bound. ``a_total`` is the vehicle's: ‖u + f‖ never exceeds it. The box is where vehicles may
    be: plans keep k·σ of the own position (``field.margin``) from its sides.
    """

    u_max: Bounds = Field(
        (2.0, 2.0, 2.0), description="m/s² an axis, of the input u without the field's force"
    )
    u_min: Floors | None = Field(
        None, description="m/s² an axis, least value of the input u, -0.1 at most; null: -u_max"
    )
    v_max: Bounds = Field((5.0, 5.0, 5.0), description="m/s an axis")
    v_min: Floors | None = Field(None, description="m/s an axis, least velocity, -0.1 at most; null: -v_max")
    a_total: float = Field(7.0, gt=0.0, le=30.0, description="m/s²; the firefly at 35° of tilt has 6.9")
    j_max: Bounds | None = Field(
        None,
        description="m/s³ an axis: a hard bound on how fast a plan's acceleration changes; null: none, as the"
        " paper",
    )
    box_min: Triple = Field((-20.0, -20.0, 3.0), description="m, ENU: lowest corner of where vehicles may be")
    box_max: Triple = Field((20.0, 20.0, 10.0), description="m, ENU: highest corner of where vehicles may be")

    @model_validator(mode="after")
    def _box(self) -> LimitsConfig:
        if any(low >= high for low, high in zip(self.box_min, self.box_max, strict=True)):
            raise ValueError("box_min must lie below box_max on every axis")
        if self.a_total < max(self.u_max):
            raise ValueError("a_total must be at least the largest u_max")
        if self.a_total < max(self.strongest):
            raise ValueError("a_total must be at least the largest -u_min")
        return self

    @property
    def least_u(self) -> Triple:
        """Least input on each axis, m/s²: ``u_min``, or −u_max without it."""
        return _negative(self.u_max) if self.u_min is None else self.u_min

    @property
    def least_v(self) -> Triple:
        """Least velocity on each axis, m/s: ``v_min``, or −v_max without it."""
        return _negative(self.v_max) if self.v_min is None else self.v_min

    @property
    def strongest(self) -> Triple:
        """Largest |u| on each axis, m/s², in the direction that allows more."""
        return _each(max, self.least_u, self.u_max)

    @property
    def weakest(self) -> Triple:
        """Largest |u| on each axis, m/s², that both directions allow."""
        return _each(min, self.least_u, self.u_max)

    @property
    def fastest(self) -> Triple:
        """Largest speed on each axis, m/s, in the direction that allows more."""
        return _each(max, self.least_v, self.v_max)

    def within(self, margin: float) -> LimitsConfig:
        """Return the limits with a box that is smaller by ``margin`` (m) on each side.

        On an axis with too little room each side moves by at most a quarter of the length.
        """
        sides = tuple(zip(self.box_min, self.box_max, strict=True))
        off = tuple(min(margin, (high - low) / 4.0) for low, high in sides)
        return self.model_copy(
            update={
                "box_min": tuple(low + by for (low, _), by in zip(sides, off, strict=True)),
                "box_max": tuple(high - by for (_, high), by in zip(sides, off, strict=True)),
            }
        )


def _negative(bounds: Triple) -> Triple:
    x, y, z = bounds
    return -x, -y, -z


def _each(of: Callable[[float, float], float], least: Triple, most: Triple) -> Triple:
    """Return for each axis the larger or smaller magnitude of its two bounds."""
    x, y, z = (of(-low, high) for low, high in zip(least, most, strict=True))
    return x, y, z


class Potential(Settings):
    """Parameters of F_hyp in eq. (9)."""

    gain: Positive
    d_min: Positive
    d_safe: Positive

    @model_validator(mode="after")
    def _order(self) -> Self:
        if self.d_safe <= self.d_min:
            raise ValueError("d_safe must be larger than d_min")
        return self


class FieldConfig(Potential):
    """Repulsive field, eq. (9)."""

    gain: Positive = Field(10.0, description="K; the paper gives none")
    d_min: Positive = Field(0.5, description="m, between centres: the field is clamped there")
    d_safe: Positive = Field(3.0, description="m, between centres: the field begins there")
    braking: Positive | None = Field(
        4.0,
        description="m/s², relative deceleration to count on when closing; null is the paper's bare field",
    )

    turn: float = Field(
        0.0,
        ge=0.0,
        le=1.0,
        description="rad: by so much the force of what closes in is turned to the side of `turning_sense`, so"
        " that a vehicle that is met head on moves aside and not ahead",
    )
    reaction: float = Field(
        0.0, ge=0.0, le=2.0, description="s that pass until a vehicle brakes: with bounded jerk about a/(2 j)"
    )
    smoothing_us: int = Field(
        50_000, ge=0, le=2_000_000, description="time constant of the field's low-pass, µs; 0 for none"
    )
    downwash: float = Field(
        1.0,
        ge=1.0,
        le=20.0,
        description="height over width of the ellipsoid in which the distance of two vehicles is measured:"
        " differences in height are divided by it; 1: a ball. In certified mode the same for the fleet",
    )
    position_sigma: float = Field(
        0.0, ge=0.0, le=5.0, description="m, σ of a vehicle's estimated position on its worst axis"
    )
    margin_sigmas: float = Field(
        2.0, ge=0.0, le=6.0, description="k: the field's distances grow by k·σ of the error of a distance"
    )

    def margin(self, estimates: int) -> float:
        """Return by how much (m) d_min and d_safe grow where a distance is known from so many ``estimates``.

        It is k·σ·√n, with n = 2 between vehicles and 1 to what stands still.
        """
        return self.margin_sigmas * self.position_sigma * math.sqrt(estimates)


class TangentialConfig(Settings):
    """Tangential band, Sec. III-D.3."""

    k_tang: Positive = Field(2.0, description="gain of the tangential force")
    d_band: Positive = Field(1.0, description="m beyond d_safe; more than v_max·dt + u_max·dt²/2")
    reach_s: float = Field(0.5, ge=0.0, le=5.0, description="the band grows by this times the closing speed")
    d_full: Positive = Field(1.0, description="m, between centres: the force is at its full there")
    omega_scale: float = Field(0.1, gt=0.0, le=1.0, description="Ω_t,min / Ω_t,max inside the band")
    force_max: Positive = Field(6.0, description="m/s²; above u_max, or the input cancels it")
    pass_speed: Positive = Field(5.0, description="m/s sideways at which the force is gone; whole up to half")
    gap: float = Field(
        3.2, ge=0.0, le=100.0, description="m between surfaces; what is nearer to each other is passed as one"
    )
    wrong_side: tuple[Sine, Sine] | None = Field(
        (0.4, 0.8),
        description="sines of the bearing, from the course to the side on which a common turning sense does"
        " not pass an obstacle: whole up to the first, zero from the second on; null: whole everywhere",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.wrong_side is not None and not self.wrong_side[0] < self.wrong_side[1]:
            raise ValueError(f"wrong_side {list(self.wrong_side)}: the first must be less than the second")
        return self


class SwivelConfig(Settings):
    """Swivelling destination, Sec. III-D.1."""

    k_s: Positive = Field(0.08, description="rad per m of ‖∇J‖/Ω_t; the paper has 0.05 of its own gradient")
    arrived: Positive = Field(0.3, description="‖∇J‖ below which the vehicle is there and its sense is free")


class ApproachAngleConfig(Potential):
    """Field of approach angles, Sec. III-D.2.

    Its distances are squares of angles, rad².
    """

    gain: Positive = Field(2.0, description="K of the angles")
    d_min: Positive = Field(0.01, description="rad²: the field is clamped there")
    d_safe: Positive = Field(1.0, description="rad²: the field begins there; (2π/8)² is 0.62")
    force_max: Positive = Field(4.0, description="m/s²; above u_max, or the input cancels it")
    pass_speed: Positive = Field(3.0, description="m/s across at which the force is gone; whole up to half")
    reach: Positive = Field(6.0, description="m: neighbours further away have no effect")


class HeadingConfig(Settings):
    """Limits of the planned yaw, and the weight of its effort."""

    rate_max: Positive = Field(3.0, description="rad/s")
    acceleration_max: Positive = Field(
        1.6, description="rad/s²; the firefly's yaw torque gives 2.5 at hover, less while it turns hard"
    )
    effort: Positive = Field(1e-4, description="s⁴, weight of (yaw acceleration)² against (yaw error)²")
    blind: Positive = Field(0.1, description="m, horizontally: bearings to a nearer target are not used")


FADING = 1.0
"""Distance (m) over which a force fades out: beyond ``reach``, behind, and near the target.

At the target there is no bearing.
"""
