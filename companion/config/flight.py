"""Settings of a flight: age limits, periods, tracking and telemetry."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from companion.config.estimation import Micros
from companion.values.settings import Positive, Settings


class GuardConfig(Settings):
    """Age limits (µs) of a plan's inputs, and limits beyond which the companion reacts."""

    own_stale_us: Micros = Field(
        500_000, description="µs: an own position older than this is not planned from"
    )
    hold_us: Micros = Field(500_000, description="µs: a plan is held for this long after the last new one")
    target_stale_us: Micros = Field(
        3_000_000, description="µs: a target whose last measurement is older than this is lost"
    )
    plan_stale_us: Micros = Field(500_000, description="a shared horizon older than this is not used")
    go_keeps_us: int = Field(
        30_000_000,
        gt=0,
        le=600_000_000,
        description="µs: a go that has not armed the vehicle by then is cancelled",
    )
    landing_speed: Positive = Field(0.3, description="m/s; slower than this a vehicle may land")
    landing_clearance: Positive = Field(1.0, description="m, horizontally to the nearest obstacle, to land")
    settle_us: int = Field(
        30_000_000, ge=0, le=600_000_000, description="µs: after this long the vehicle lands without settling"
    )
    own_lost_us: int = Field(
        5_000_000, gt=0, le=60_000_000, description="µs without own state after which the vehicle lands"
    )
    unsolved_us: int = Field(
        5_000_000, gt=0, le=60_000_000, description="µs without a plan after which the vehicle lands"
    )
    neighbour_lost_us: int = Field(
        3_000_000,
        gt=0,
        le=600_000_000,
        description="µs: a neighbour silent for longer is a concern, and the vehicle flies cautiously",
    )
    flown_on_us: int = Field(
        0,
        ge=0,
        le=60_000_000,
        description="an autopilot may fly on for so long without its companion (GUID_TIMEOUT, "
        "COM_OF_LOSS_T): a neighbour that falls silent may be anywhere on that path; 0: its track is "
        "extrapolated as usual",
    )
    cautious_speed: Positive | None = Field(
        None,
        description="m/s in addition to the target's speed: limit for a vehicle that flies cautiously, as "
        "after missed deadlines or without messages of a neighbour",
    )
    unheard_us: Micros | None = Field(
        None,
        description="µs: a vehicle flies slower the nearer a neighbour may be that has lately been silent for"
        " longer, and the distances to it grow (field); null: it does not",
    )
    unheard_speed: Positive = Field(
        1.0,
        description="m/s: the field's distances to an unheard neighbour grow at this rate, until"
        " neighbour_lost_us; and at least this speed is allowed beside one that counts as gone,"
        " and away from one that is too near",
    )
    unheard_wait_us: int = Field(
        15_000_000,
        ge=0,
        le=600_000_000,
        description="µs: with unheard_us a vehicle keeps clear of all places that a neighbour may have"
        " reached since it was heard, until it has been silent for longer; then it counts as gone",
    )
    late_us: Micros = Field(100_000, description="µs: a step that is later is a missed deadline")
    battery_low: float = Field(
        0.2, ge=0.0, le=1.0, description="share left below which the vehicle returns and lands"
    )
    battery_critical: float = Field(
        0.1, ge=0.0, le=1.0, description="share left below which the vehicle lands"
    )
    fence_radius: float | None = Field(
        None, gt=0.0, description="m from the fleet origin, horizontally; beyond, the vehicle returns"
    )
    fence_height: float | None = Field(
        None, gt=0.0, description="m above the fleet origin; beyond, the vehicle returns"
    )
    least_height: Positive | None = Field(
        None,
        description="m above the place of the take-off; plans of the field go no lower, as with the floor of"
        " the box, whichever is higher, but the last quarter of the box stays free; null: the box alone",
    )
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
        description="m: on the way back the vehicles fly so far above each other, in the order of their ids,"
        " all of them above the distance that the target keeps; each climbs first; not with committed plans"
        " that are planar, which keep their height",
    )
    near: Positive | None = Field(
        None,
        description="m to a neighbour: nearer is a concern, and the vehicle flies cautiously; null: none",
    )


class RatesConfig(Settings):
    """Periods of the companion's activities, µs."""

    replan_us: Micros = Field(
        10_000, description="µs between plans; with the field, more than 50000 in a file gives a warning"
    )
    setpoint_us: Micros = Field(20_000, description="µs between set-points")
    state_us: Micros = Field(100_000, description="µs between messages of the own state to the others")
    plan_us: Micros = Field(100_000, description="µs between messages of the own plan to the others")
    plan_after_us: int = Field(
        0,
        ge=0,
        le=5_000_000,
        multiple_of=4,
        description="µs from the first message of the own state to the first of the own plan (field). If"
        " plan_us and state_us are equal: with 0 both are in one datagram, which is lost as a whole; with"
        " half of state_us each has a datagram of its own",
    )
    detection_us: Micros = Field(
        100_000, description="µs between two forwarded detections, at least (target_source: fused)"
    )


class TrackingConfig(Settings):
    """Compensation of drag and wind, and limits of the tracking error."""

    compensate: bool = Field(
        False, description="add to the set-point's acceleration what drag and wind take from the vehicle"
    )
    bandwidth: float = Field(3.5, gt=0.0, le=20.0, description="1/s, of the disturbance observer")
    lag: float = Field(0.18, ge=0.0, le=2.0, description="s, of the autopilot's attitude loop")
    most: float = Field(4.0, ge=0.0, le=10.0, description="m/s², of the compensation")
    usual: Positive | None = Field(
        None,
        description="m: by its recent tracking error beyond this, all distances grow; null: they do not",
    )
    alarm: Positive | None = Field(
        None, description="m: a larger error is a concern, and the vehicle flies cautiously; null: none is"
    )

    @property
    def largest(self) -> float:
        """Largest compensation, m/s²."""
        return self.most if self.compensate else 0.0


class GroundMessagesConfig(Settings):
    """Messages to the ground, and the links that carry them.

    The autopilot's link is usually the narrowest, and whether the autopilot forwards messages depends on its
    own settings: so this link carries none unless configured.
    """

    texts: bool = Field(False, description="events as STATUSTEXT")
    values: bool = Field(
        False,
        description="plan time and the like as NAMED_VALUE_FLOAT, once a second; no two flights then send "
        "the same bytes",
    )
    links: tuple[Literal["ground", "autopilot"], ...] = Field(
        ("ground",), max_length=2, description="links on which these messages are sent"
    )
