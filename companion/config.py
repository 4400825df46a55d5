"""The companion's settings: frozen, checked at load, passed explicitly. SI units, fleet-local ENU, times in
µs.

Defaults are the paper's where it gives a number; where it is silent, the value that we settled on stands
here. A scenario file may say otherwise.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from companion.certified.settings import CertifiedConfig
from companion.formation import FormationConfig, Nearest
from companion.moving import Moving, MovingPost, MovingSphere
from companion.obstacles import Obstacle, Post, Sphere
from companion.proximity import ProximityConfig
from companion.settings import Positive, Settings, WireStep
from companion.surfaces import Circle, Surface, SurfaceConfig
from companion.target_source import GlobalPositionSource, TargetSource
from companion.tracking import TrackingConfig
from companion.traffic import TrafficConfig
from companion.voice import VoiceConfig

MethodName = Literal["baseline", "swivel", "approach_angle", "tangential"]
Avoidance = Literal["field", "certified"]
TurningSense = Literal["own", "right", "left"]
Micros = Annotated[int, Field(gt=0, le=10_000_000, multiple_of=4)]
Triple = tuple[float, float, float]
Bounds = tuple[
    Annotated[float, Field(gt=0.0, le=100.0)],
    Annotated[float, Field(gt=0.0, le=100.0)],
    Annotated[float, Field(gt=0.0, le=100.0)],
]


__all__ = [
    "CompanionConfig",
    "Moving",
    "MovingPost",
    "MovingSphere",
    "Obstacle",
    "Post",
    "Settings",
    "Sphere",
]


class HorizonConfig(Settings):
    """N steps of dt; N + 1 inputs u(0)…u(N)."""

    steps: int = Field(15, ge=2, le=15, description="N; at most 15, so that a plan fits one TUNNEL message")
    dt_us: WireStep = Field(100_000, description="prediction step, µs; not the replan period")


class CostConfig(Settings):
    """Ω_t and Ω_i. Only their ratios matter. Not given in the paper: settled by
    flying the swap and the escort."""

    omega_t_position: Positive = 100.0
    omega_t_velocity: Positive = 40.0
    omega_i: Positive = 0.5


class LimitsConfig(Settings):
    """What the planner may ask for. ``a_total`` is the vehicle's: ‖u + f‖ never exceeds it. The box is where
    vehicles may be: plans stay inside by k·σ of the own place (``field.margin``)."""

    u_max: Bounds = (2.0, 2.0, 2.0)
    v_max: Bounds = (5.0, 5.0, 5.0)
    a_total: float = Field(7.0, gt=0.0, le=30.0, description="m/s²; the firefly at 35° of tilt has 6.9")
    j_max: Bounds | None = Field(
        None,
        description="m/s³ an axis: a hard bound on how fast a plan's acceleration changes; null: none, as the"
        " paper",
    )
    box_min: Triple = (-20.0, -20.0, 3.0)
    box_max: Triple = (20.0, 20.0, 10.0)

    @model_validator(mode="after")
    def _box(self) -> LimitsConfig:
        if any(low >= high for low, high in zip(self.box_min, self.box_max, strict=True)):
            raise ValueError("box_min must lie below box_max on every axis")
        if self.a_total < max(self.u_max):
            raise ValueError("a_total must be at least the largest u_max")
        return self

    def within(self, margin: float) -> LimitsConfig:
        """The same with a box that is smaller by ``margin`` (m) on each side, or half as large where there is
        no room for that."""
        sides = tuple(zip(self.box_min, self.box_max, strict=True))
        off = tuple(min(margin, (high - low) / 4.0) for low, high in sides)
        return self.model_copy(
            update={
                "box_min": tuple(low + by for (low, _), by in zip(sides, off, strict=True)),
                "box_max": tuple(high - by for (_, high), by in zip(sides, off, strict=True)),
            }
        )


class Potential(Settings):
    """What F_hyp of eq. (8) needs."""

    gain: Positive
    d_min: Positive
    d_safe: Positive

    @model_validator(mode="after")
    def _order(self) -> Self:
        if self.d_safe <= self.d_min:
            raise ValueError("d_safe must be larger than d_min")
        return self


class FieldConfig(Potential):
    """The repulsive field, eq. (8)."""

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
    position_sigma: float = Field(
        0.0, ge=0.0, le=5.0, description="m, σ of a vehicle's estimated position on its worst axis"
    )
    margin_sigmas: float = Field(
        2.0, ge=0.0, le=6.0, description="k: the field's distances grow by k·σ of the error of a distance"
    )

    def margin(self, estimates: int) -> float:
        """By how much (m) d_min and d_safe grow where a distance is known from so many estimates: k·σ·√n,
        n = 2 between vehicles, 1 to what stands."""
        return self.margin_sigmas * self.position_sigma * math.sqrt(estimates)


class TangentialConfig(Settings):
    """The tangential band, Sec. III-C.3."""

    k_tang: Positive = 2.0
    d_band: Positive = Field(1.0, description="m beyond d_safe; more than v_max·dt + u_max·dt²/2")
    reach_s: float = Field(0.5, ge=0.0, le=5.0, description="the band grows by this times the closing speed")
    d_full: Positive = Field(1.0, description="m, between centres: the force is at its full there")
    omega_scale: float = Field(0.1, gt=0.0, le=1.0, description="Ω_t,min / Ω_t,max inside the band")
    force_max: Positive = Field(6.0, description="m/s²; above u_max, or the input cancels it")
    pass_speed: Positive = Field(5.0, description="m/s sideways at which the force is gone; whole up to half")
    gap: float = Field(
        3.2, ge=0.0, le=100.0, description="m between surfaces; what is nearer to each other is passed as one"
    )


class SwivelConfig(Settings):
    """The swivelling destination, Sec. III-C.1."""

    k_s: Positive = Field(0.08, description="rad per m of ‖∇J‖/Ω_t; the paper has 0.05 of its own gradient")
    arrived: Positive = Field(0.3, description="‖∇J‖ below which the vehicle is there and its sense is free")


class ApproachAngleConfig(Potential):
    """The field of approach angles, Sec. III-C.2. Its distances are squares of angles, rad²."""

    gain: Positive = Field(2.0, description="K of the angles")
    d_min: Positive = Field(0.01, description="rad²: the field is clamped there")
    d_safe: Positive = Field(1.0, description="rad²: the field begins there; (2π/8)² is 0.62")
    force_max: Positive = Field(4.0, description="m/s²; above u_max, or the input cancels it")
    pass_speed: Positive = Field(3.0, description="m/s across at which the force is gone; whole up to half")
    reach: Positive = Field(6.0, description="m: who is further off is not met yet")


class OwnSurface(Settings):
    """The surface of one vehicle."""

    vehicle: int = Field(ge=1, le=255, description="system id")
    surface: SurfaceConfig


class TrackConfig(Settings):
    """A filterpy track of one sender."""

    sigma_position: Positive = Field(0.02, description="m")
    sigma_velocity: Positive = Field(0.05, description="m/s")
    sigma_acceleration: Positive = Field(2.0, description="m/s², of the constant-velocity model")
    sigma_turn: float = Field(
        0.0, ge=0.0, le=10.0, description="rad/s, of the rates at which its course turns; 0: it goes straight"
    )
    turn_memory_us: Micros = Field(3_000_000, description="so long a turn lasts")
    delay_us: int = Field(
        20_000, ge=0, le=2_000_000, description="least age of a message when it arrives; jitter adds to it"
    )
    stamps: bool = Field(True, description="date by the sender's time_boot_ms; false: by the arrival alone")
    rewind_us: int = Field(
        2_000_000, ge=0, le=10_000_000, description="how late a message may be and still be put in its place"
    )
    extrapolate_us: Micros = Field(1_000_000, description="no track is carried further than this")
    gate: Positive = Field(
        22.46, description="on d² = yᵀS⁻¹y, χ² of six: 16.81 passes 99 % of what is true, 22.46 99.9 %"
    )
    jump: Positive = Field(
        3.0, description="m and m/s: an innovation beyond it is refused too; it grows by this per second"
    )
    witnesses: int = Field(
        2, ge=1, le=10, description="refused measurements that agree with each other and are then believed"
    )
    velocity_up: bool = Field(False, description="the sender's vz is positive up, contrary to MAVLink")


class HeadingConfig(Settings):
    """What yaw may be asked of the vehicle, and how eagerly."""

    rate_max: Positive = Field(3.0, description="rad/s")
    acceleration_max: Positive = Field(
        1.6, description="rad/s²; the firefly's yaw torque gives 2.5 at hover, less while it turns hard"
    )
    effort: Positive = Field(1e-4, description="s⁴, weight of (yaw acceleration)² against (yaw error)²")
    blind: Positive = Field(0.1, description="m, horizontally: nearer than this no bearing counts")


class GuardConfig(Settings):
    """Age limits of what a plan stands on, µs."""

    own_stale_us: Micros = 500_000
    hold_us: Micros = Field(500_000, description="a plan is held for so long after the last good one")
    target_stale_us: Micros = 3_000_000
    plan_stale_us: Micros = Field(500_000, description="a shared horizon older than this is not used")
    go_keeps_us: int = Field(
        30_000_000, gt=0, le=600_000_000, description="a go that has not armed it by then is forgotten"
    )
    landing_speed: Positive = Field(0.3, description="m/s; slower than this a vehicle may land")
    landing_clearance: Positive = Field(1.0, description="m, horizontally to the nearest neighbour, to land")
    settle_us: int = Field(30_000_000, ge=0, le=600_000_000, description="longest way from escort to landing")
    own_lost_us: int = Field(
        5_000_000, gt=0, le=60_000_000, description="without own state for so long, it is told to land"
    )
    unsolved_us: int = Field(
        5_000_000, gt=0, le=60_000_000, description="without a plan for so long, it is told to land"
    )
    neighbour_lost_us: int = Field(
        3_000_000, gt=0, le=600_000_000, description="said then, and kept away from"
    )
    flown_on_us: int = Field(
        0,
        ge=0,
        le=60_000_000,
        description="an autopilot may fly on for so long without its companion (GUID_TIMEOUT, "
        "COM_OF_LOSS_T): a neighbour that falls silent may be anywhere on that way; 0: it is carried on "
        "as any track is",
    )
    cautious_speed: Positive | None = Field(
        None,
        description="m/s, beside the target's: who misses deadlines, or hears a neighbour no more, flies "
        "about so fast at most",
    )
    late_us: Micros = Field(100_000, description="a step later than that is a missed deadline")
    battery_low: float = Field(0.2, ge=0.0, le=1.0, description="share left: it comes back and lands")
    battery_critical: float = Field(0.1, ge=0.0, le=1.0, description="share left: it lands")
    fence_radius: float | None = Field(None, gt=0.0, description="m from the fleet origin: it comes back")
    fence_height: float | None = Field(None, gt=0.0, description="m above the fleet origin: it comes back")
    displaced: Positive = Field(
        5.0, description="m by which the own place may change with the autopilot's origin; beyond, it lands"
    )
    tube: Positive = Field(1.0, description="m of tracking error at which the plan is anchored anew")
    blend: Positive | None = Field(
        None,
        description="1/s: a plan begins between the last plan and the vehicle, and comes nearer to it at this"
        " rate; out of the tube by 0.2 m a plan; null: on the plan, and out of the tube where the vehicle is",
    )
    astray_us: int = Field(
        0,
        ge=0,
        le=10_000_000,
        description="a vehicle beside its plan comes back to it with this time constant: own and others' ways"
        " are taken so; 0: as planned while within 1 m",
    )
    return_step: float = Field(
        0.0,
        ge=0.0,
        le=20.0,
        description="m: on the way back the vehicles fly so far above each other, in the order of their ids",
    )
    near: Positive | None = Field(
        None,
        description="m to a neighbour: nearer is a concern, and the vehicle flies cautiously; null: none",
    )


class RatesConfig(Settings):
    """Periods of what the companion does, µs."""

    replan_us: Micros = 10_000
    setpoint_us: Micros = 20_000
    state_us: Micros = 100_000
    plan_us: Micros = 100_000


class CompanionConfig(Settings):
    """Everything one companion needs beside its links."""

    task: Literal["escort", "goto"] = "escort"
    methods: tuple[MethodName, ...] = ("tangential",)
    turning_sense: TurningSense = Field(
        "own", description="'own': by approach, as the paper; otherwise one sense for all vehicles"
    )
    avoidance: Avoidance = Field(
        "field", description="'field': the paper's; 'certified': committed plans between moving planes"
    )
    planar: bool = False
    shares_plan: bool = Field(True, description="tell the others the horizon that is flown")
    neighbour_prediction: Literal["held", "velocity"] = Field(
        "held",
        description="without a shared horizon: the paper holds the n = 0 position; 'velocity' moves it on",
    )
    setpoint_lead_us: int = Field(10_000, ge=0, le=1_600_000, description="look-ahead of the set-point")
    own: TrackConfig = TrackConfig(delay_us=5_000, sigma_acceleration=10.0)
    neighbour: TrackConfig = TrackConfig()
    target: TrackConfig = TrackConfig(
        sigma_position=1.0, sigma_velocity=0.3, sigma_acceleration=1.0, sigma_turn=0.5, jump=8.0
    )
    target_source: TargetSource = Field(GlobalPositionSource(), description="what tells where the target is")
    target_d_min: float | None = Field(None, gt=0.0, le=100.0, description="the target is an obstacle, m")
    target_d_safe: float | None = Field(None, gt=0.0, le=100.0)
    obstacles: tuple[Obstacle, ...] = Field((), max_length=500, description="fixed; the field is about them")
    moving: tuple[Moving, ...] = Field(
        (), max_length=100, description="who of those heard on the swarm link is an obstacle, and how large"
    )
    proximity: ProximityConfig | None = Field(
        None, description="obstacles from OBSTACLE_DISTANCE; null: not listened to"
    )
    traffic: TrafficConfig | None = Field(
        None, description="obstacles from ADSB_VEHICLE; null: not listened to"
    )
    horizon: HorizonConfig = HorizonConfig()
    cost: CostConfig = CostConfig()
    limits: LimitsConfig = LimitsConfig()
    limits_from_autopilot: bool = Field(
        False,
        description="read before the go, from the autopilot's parameters, what it can follow, and lower the"
        " limits to it; with avoidance 'field'",
    )
    field: FieldConfig = FieldConfig()
    tangential: TangentialConfig = TangentialConfig()
    swivel: SwivelConfig = SwivelConfig()
    approach_angle: ApproachAngleConfig = ApproachAngleConfig()
    surface: SurfaceConfig = Circle()
    surfaces: tuple[OwnSurface, ...] = Field(
        (), max_length=255, description="of vehicles that have their own"
    )
    formation: FormationConfig = Field(
        Nearest(), description="how the vehicles share the surface: each its nearest point, or spread evenly"
    )
    turn_rate: float = Field(
        0.0, ge=-1.0, le=1.0, description="rad/s, counter-clockwise from above: the ring turns on its surface"
    )
    heading: HeadingConfig = HeadingConfig()
    tracking: TrackingConfig = TrackingConfig()
    certified: CertifiedConfig = CertifiedConfig()
    guard: GuardConfig = GuardConfig()
    rates: RatesConfig = RatesConfig()
    voice: VoiceConfig = VoiceConfig()

    def surface_of(self, system: int) -> Surface:
        """Where the vehicle of that system id is to be around the target."""
        return next((own.surface for own in self.surfaces if own.vehicle == system), self.surface)

    @model_validator(mode="after")
    def _consistent(self) -> CompanionConfig:
        dt = self.horizon.dt_us * 1e-6
        least = max(self.limits.v_max[:2]) * dt + max(self.limits.u_max[:2]) * dt**2 / 2
        if self.tangential.d_band <= least:
            raise ValueError(f"tangential.d_band must exceed v_max·dt + u_max·dt²/2 = {least:.2f} m")
        longest = (self.horizon.steps + 1) * self.certified.dt_us
        if self.certified.epoch_us > longest:
            raise ValueError(f"certified.epoch_us must not exceed (N + 1)·certified.dt_us = {longest}")
        for name in ("tangential", "approach_angle"):
            if name in self.methods and getattr(self, name).force_max <= max(self.limits.u_max):
                raise ValueError(f"{name}.force_max must exceed u_max, or the input cancels it")
        if len(set(self.methods)) != len(self.methods):
            raise ValueError("methods: a method is there twice; allowed: once")
        systems = [one.system for one in self.moving]
        for system in systems:
            if systems.count(system) > 1:
                raise ValueError(f"moving: system {system} is there twice; allowed: once")
        if (self.target_d_min is None) != (self.target_d_safe is None):
            raise ValueError("target_d_min and target_d_safe come together")
        nearest = self.field.d_safe
        if self.target_d_min is not None and self.target_d_safe is not None:
            if self.target_d_safe <= self.target_d_min:
                raise ValueError("target_d_safe must be larger than target_d_min")
            nearest = min(nearest, self.target_d_safe)
        if self.tangential.d_full >= nearest:
            raise ValueError(f"tangential.d_full must be less than d_safe, here {nearest:g} m")
        return self
