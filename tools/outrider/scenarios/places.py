"""Places of a scenario: its origin, the starts and goals of the vehicles, and the target."""

from __future__ import annotations

from math import pi, sin
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from outrider.scenarios.part import Coordinate, Duration, Length, Part, Position, Seconds, System


class Origin(Part):
    """Origin of the fleet-local ENU frame."""

    latitude: float = Field(47.397742, ge=-89.0, le=89.0, description="degrees")
    longitude: float = Field(8.545594, ge=-180.0, le=180.0, description="degrees")
    altitude: float = Field(488.0, ge=-500.0, le=9000.0, description="m above mean sea level")


class Ring(Part):
    """Starts evenly on a circle, hovering at ``height`` above the ground.

    Each start is jittered within a ball, per seed.
    """

    kind: Literal["ring"]
    centre: tuple[Coordinate, Coordinate] = Field((0.0, 0.0), description="m east and north")
    radius: Length = Field(description="m")
    apart: Length | None = Field(
        None, description="m, of neighbours; the radius grows until there is room for all of them"
    )
    height: float = Field(
        5.0, ge=0.5, le=100.0, description="m above ground, where the vehicles hover at first"
    )
    jitter: float = Field(0.0, ge=0.0, le=2.0, description="m, radius of the ball around each start")
    first_deg: float = Field(
        0.0, ge=-360.0, le=360.0, description="first vehicle's angle from east towards north"
    )

    def radius_of(self, count: int) -> float:
        """Return the radius (m) with ``count`` vehicles.

        If ``apart`` is given, neighbours are at least ``apart`` from each other with any jitter within its
        bounds.
        """
        if self.apart is None or count < 2:
            return self.radius
        return max(self.radius, 0.5 * (self.apart + 2.0 * self.jitter) / sin(pi / count))


class Points(Part):
    """Starts at given places, in the order of the vehicles, and the goals of a task 'goto'."""

    kind: Literal["points"]
    at: tuple[Position, ...] = Field(min_length=1, max_length=244, description="m, ENU; hovering there")
    goals: tuple[Position, ...] | None = Field(None, description="m, ENU; one for each vehicle")
    jitter: float = Field(0.0, ge=0.0, le=2.0, description="m, radius of the ball around each start")

    @model_validator(mode="after")
    def _pairs(self) -> Self:
        if self.goals is not None and len(self.goals) != len(self.at):
            raise ValueError(f"goals: {len(self.goals)} for {len(self.at)} places in at; one each is allowed")
        low = min(place[2] for place in self.at)
        if low < 0.5:
            raise ValueError(f"at: a vehicle hovers at {low} m; at least 0.5 m above the ground is allowed")
        return self


class Bystander(Part):
    """An additional vehicle that shares no plan and does not give way.

    It hovers at its place, or with a ``goal`` flies straight there, ``after_s`` seconds after the goal event.
    """

    at: Position = Field(description="m, ENU; hovering there at first")
    goal: Position | None = Field(None, description="m, ENU; null: it stays")
    after_s: Seconds = Field(0.0, description="s after the goal event at which it sets off")
    speed: float | None = Field(None, gt=0.0, le=20.0, description="m/s; null: as fast as the others may be")
    jitter: float = Field(0.0, ge=0.0, le=2.0, description="m, radius of the ball around its place")

    @model_validator(mode="after")
    def _in_the_air(self) -> Self:
        if self.at[2] < 0.5:
            raise ValueError(f"at: it hovers at {self.at[2]} m; at least 0.5 m above the ground is allowed")
        return self


class Jump(Part):
    """Jump of the target to another place, ``after_s`` seconds after the goal event."""

    after_s: Seconds = Field(description="s after the goal event")
    to: Position = Field(description="m, ENU")


class FixedTarget(Part):
    """A target that stays; it jumps at the goal event with ``jump_to``, and later with ``jumps``."""

    kind: Literal["fixed"]
    at: Position = Field(description="m, ENU")
    jump_to: Position | None = Field(
        None, description="m, ENU: where it is from the goal event on; null: it stays"
    )
    jumps: tuple[Jump, ...] = Field((), description="in the order of time")
    rate_hz: float = Field(5.0, gt=0.0, le=50.0, description="Hz, of its position messages")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        times = [jump.after_s for jump in self.jumps]
        if times != sorted(times):
            raise ValueError("jumps must be in the order of after_s")
        return self


class Pace(Part):
    """Change of the target's speed, ``after_s`` seconds after the goal event."""

    after_s: Seconds = Field(description="s after the goal event")
    speed: float = Field(ge=0.0, le=20.0, description="m/s")


class PathTarget(Part):
    """A target on a smooth closed path through some places, at a constant speed.

    It starts at the goal event. With ``paces`` it changes its speed later.
    """

    kind: Literal["path"]
    through: tuple[Position, ...] = Field(min_length=3, max_length=100, description="m, ENU; in this order")
    speed: float = Field(ge=0.0, le=20.0, description="m/s")
    paces: tuple[Pace, ...] = Field((), max_length=100, description="in the order of time")
    setting_out: float = Field(1.0, gt=0.0, le=10.0, description="m/s², until it has its speed")
    rate_hz: float = Field(5.0, gt=0.0, le=50.0, description="Hz, of its position messages")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        times = [pace.after_s for pace in self.paces]
        if times != sorted(times):
            raise ValueError("paces must be in the order of after_s")
        return self


class RecordedTarget(Part):
    """A target from a real flight: GLOBAL_POSITION_INT frames of a tlog, unchanged, at recorded times."""

    kind: Literal["recorded"]
    log: str = Field(description="tlog, relative to config/logs")
    system: System = Field(description="system id of the recorded vehicle")
    start_s: Seconds = Field(description="after the log's first record")
    duration_s: Duration = Field(description="s of the log that are flown")


Starts = Annotated[Ring | Points, Field(discriminator="kind")]
Target = Annotated[FixedTarget | PathTarget | RecordedTarget, Field(discriminator="kind")]
