"""Settings of a companion: frozen, checked at load, passed explicitly.

SI units, fleet-local ENU, times in µs. Defaults are the paper's where it gives a number; otherwise they are
the values settled on here. A scenario file may override them.
"""

from __future__ import annotations

from typing import Literal

from pydantic import ConfigDict, Field, model_validator

from companion.config.certified import CertifiedConfig
from companion.config.estimation import TrackConfig
from companion.config.flight import GroundMessagesConfig, GuardConfig, RatesConfig, TrackingConfig
from companion.config.formation import FormationConfig, Nearest
from companion.config.obstacles import (
    MOST_OBSTACLES,
    Moving,
    MovingPost,
    MovingSphere,
    Obstacle,
    Post,
    ProximityConfig,
    Sphere,
    TrafficConfig,
)
from companion.config.planning import (
    ApproachAngleConfig,
    CostConfig,
    FieldConfig,
    HeadingConfig,
    HorizonConfig,
    LimitsConfig,
    MethodName,
    SwivelConfig,
    TangentialConfig,
    TurningSense,
)
from companion.config.target_source import GlobalPositionSource, TargetSource
from companion.config.way import WayConfig
from companion.surfaces import Circle, Surface, SurfaceConfig
from companion.values.settings import Settings

Avoidance = Literal["field", "certified"]


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


class OwnSurface(Settings):
    """Surface of one vehicle."""

    vehicle: int = Field(ge=1, le=255, description="system id")
    surface: SurfaceConfig = Field(description="surface around the target for this vehicle")


class CompanionConfig(Settings):
    """All settings of one companion, except its links."""

    model_config = ConfigDict(json_schema_extra={"renamed": {"voice": "ground_messages"}})

    task: Literal["escort", "goto"] = Field(
        "escort", description="escort: on a surface around the target; goto: to ordered goals"
    )
    methods: tuple[MethodName, ...] = Field(
        ("tangential",),
        description="methods to leave the field's local minima, in this order; baseline adds nothing",
    )
    turning_sense: TurningSense = Field(
        "own",
        description="'own': by approach, as the paper; otherwise one sense for all vehicles."
        " Committed plans turn to the right unless it is 'left': with 'own', too",
    )
    avoidance: Avoidance = Field(
        "field", description="'field': the paper's; 'certified': committed plans between moving planes"
    )
    planar: bool = Field(False, description="plans keep the height at which they begin, as in the paper")
    shares_plan: bool = Field(True, description="send the flown horizon to the others")
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
    target_source: TargetSource = Field(GlobalPositionSource(), description="source of the target's position")
    target_d_min: float | None = Field(None, gt=0.0, le=100.0, description="the target is an obstacle, m")
    target_d_safe: float | None = Field(
        None,
        gt=0.0,
        le=100.0,
        description="m: at this distance from the target its force begins; with target_d_min",
    )
    obstacles: tuple[Obstacle, ...] = Field((), max_length=MOST_OBSTACLES, description="fixed obstacles")
    way: WayConfig | None = Field(
        None, description="ways around fixed obstacles where they block the straight one; null: none"
    )
    moving: tuple[Moving, ...] = Field(
        (), max_length=100, description="senders on the swarm link that are obstacles, and their sizes"
    )
    proximity: ProximityConfig | None = Field(
        None, description="obstacles from OBSTACLE_DISTANCE; null: ignored"
    )
    traffic: TrafficConfig | None = Field(None, description="obstacles from ADSB_VEHICLE; null: ignored")
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
    surface: SurfaceConfig = Field(
        Circle(), description="surface around the target on which the destinations lie"
    )
    surfaces: tuple[OwnSurface, ...] = Field(
        (), max_length=255, description="surfaces of vehicles with a surface of their own"
    )
    formation: FormationConfig = Field(
        Nearest(),
        description="how the vehicles share the surface: each its nearest point, spread evenly, or at the"
        " bearings from which all together locate the target best",
    )
    turn_rate: float = Field(
        0.0, ge=-1.0, le=1.0, description="rad/s, counter-clockwise from above: the ring turns on its surface"
    )
    heading: HeadingConfig = HeadingConfig()
    tracking: TrackingConfig = TrackingConfig()
    certified: CertifiedConfig = CertifiedConfig()
    guard: GuardConfig = GuardConfig()
    rates: RatesConfig = RatesConfig()
    ground_messages: GroundMessagesConfig = GroundMessagesConfig()

    @property
    def plane_shift(self) -> float:
        """``certified.plane_shift``; without it the one that suits flights in the plane, or in space."""
        # Rounded as in the fingerprint, so that all vehicles of a fleet have the same number.
        return round(self.certified.for_flight(planar=self.planar).plane_shift, 6)

    @property
    def committed_in_plane(self) -> bool:
        """Whether plans are committed and keep their height."""
        return self.planar and self.avoidance == "certified"

    @property
    def return_step(self) -> float:
        """``guard.return_step``, m; 0 for committed plans in the plane, which would never reach a lane."""
        return 0.0 if self.committed_in_plane else self.guard.return_step

    @property
    def shares_surface(self) -> bool:
        """Whether the destinations of the vehicles depend on each other."""
        return not isinstance(self.formation, Nearest)

    def surface_of(self, system: int) -> Surface:
        """Return the surface of the vehicle with the id ``system``."""
        return next((own.surface for own in self.surfaces if own.vehicle == system), self.surface)

    @model_validator(mode="after")
    def _consistent(self) -> CompanionConfig:
        dt = self.horizon.dt_us * 1e-6
        least = max(self.limits.fastest[:2]) * dt + max(self.limits.strongest[:2]) * dt**2 / 2
        if self.tangential.d_band <= least:
            raise ValueError(f"tangential.d_band must exceed v_max·dt + u_max·dt²/2 = {least:.2f} m")
        longest = (self.horizon.steps + 1) * self.certified.dt_us
        if self.certified.epoch_us > longest:
            raise ValueError(f"certified.epoch_us must not exceed (N + 1)·certified.dt_us = {longest}")
        most = self.certified.epoch_us - self.rates.setpoint_us
        if 2 * self.certified.clock_us >= most:
            # Step 5 of the proof: one clock may be ahead and the other behind, and a step late by a period.
            raise ValueError(
                f"certified.clock_us must be less than half of epoch_us - rates.setpoint_us, {most // 2}"
            )
        for name in ("tangential", "approach_angle"):
            if name in self.methods and getattr(self, name).force_max <= max(self.limits.strongest):
                raise ValueError(f"{name}.force_max must exceed u_max, or the input cancels it")
        if self.way is not None and self.way.lanes is not None and not self.committed_in_plane:
            raise ValueError("way.lanes: allowed only with avoidance: certified and planar: true")
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
