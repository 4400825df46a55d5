"""Scene file: rules for drawing random scenarios.

One seed gives one scenario; ``difficulty`` sets every parameter between its easy and its hard value.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, JsonValue, model_validator

from outrider.scenarios.part import Part, Share
from outrider.sweep.grid import leaves
from outrider.sweep.trouble import Trouble

Metres = Annotated[float, Field(gt=0.0, le=200.0)]
Span = tuple[Metres, Metres]
"""Interval; values are drawn uniformly from it."""
Number = Annotated[int, Field(ge=0, le=500)]
Amount = Annotated[float, Field(ge=0.0, le=50.0)]

DECIDED = (
    "name",
    "task",
    "vehicles",
    "starts",
    "target",
    "obstacles",
    "companion.task",
    "companion.limits.v_max",
    "companion.limits.v_min",
    "companion.surface.radius",
)
"""Dotted keys of a scenario that a scene decides."""


class Density(Part):
    """Vehicles for each 100 m² of the square in which they start."""

    easy: float = Field(gt=0.0, le=4.0, description="1/(100 m²), value at difficulty 0")
    hard: float = Field(gt=0.0, le=4.0, description="1/(100 m²), value at difficulty 1")


class Speed(Part):
    """Largest speed along each axis, m/s."""

    easy: float = Field(ge=0.5, le=9.0, description="m/s, value at difficulty 0")
    hard: float = Field(ge=0.5, le=9.0, description="m/s, value at difficulty 1")


class PerVehicle(Part):
    """Number for each vehicle; the total is rounded."""

    easy: Amount = Field(description="value at difficulty 0")
    hard: Amount = Field(description="value at difficulty 1")


class Count(Part):
    """Number, rounded."""

    easy: Amount = Field(description="value at difficulty 0")
    hard: Amount = Field(description="value at difficulty 1")


class Distance(Part):
    """Distance, m."""

    easy: Metres = Field(description="m, value at difficulty 0")
    hard: Metres = Field(description="m, value at difficulty 1")


class Interval(Part):
    """Interval, s; the hard value is the shorter one."""

    easy: float = Field(gt=0.0, le=600.0, description="s, value at difficulty 0")
    hard: float = Field(gt=0.0, le=600.0, description="s, value at difficulty 1")


class Things(Part):
    """Obstacles of one kind: a number for each vehicle, or a total number."""

    per_vehicle: PerVehicle | None = None
    count: tuple[Number, Number] | None = Field(
        None, description="least and most, independent of the number of vehicles; drawn uniformly"
    )

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.per_vehicle is None) == (self.count is None):
            raise ValueError("per_vehicle or count: one of them")
        return self


class Balls(Things):
    """Spheres in the air."""

    radius: Span = Field((0.5, 1.5), description="m; drawn uniformly")
    height: Span = Field((3.0, 8.0), description="m above ground, of the centres")


class Poles(Things):
    """Posts on the ground."""

    radius: Span = Field((0.2, 0.6), description="m; drawn uniformly")
    height: Span = Field((8.0, 20.0), description="m above ground, of the tops")


class Blocks(Things):
    """Boxes on the ground, turned at random."""

    size: Span = Field((0.5, 3.0), description="m, of each horizontal edge")
    height: Span = Field((2.0, 12.0), description="m above ground, of the tops")


class Jumps(Part):
    """Jumps of the target to other positions, several times; the first jump is at the goal event."""

    count: Count
    length: Distance = Field(description="m, of each jump")
    every_s: Interval


class Scene(Part):
    """Rules by which a scenario is drawn.

    All distances between positions are horizontal, so that take-off and landing are as clear as the flight.
    """

    name: str = Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,50}$", description="names the drawn scenarios, with the seed"
    )
    description: str = Field("", description="one line for lists and reports")
    task: Literal["goto", "escort"] = Field(
        description="goto: each vehicle flies to its own goal; escort: of a target that jumps"
    )
    vehicles: tuple[Annotated[int, Field(ge=2, le=200)], Annotated[int, Field(ge=2, le=200)]] = Field(
        description="least and most; drawn uniformly"
    )
    difficulty: Share = Field(0.5, description="0: all parameters are easy, 1: all are hard")
    density: Density
    speed: Speed
    height: Span = Field((4.0, 6.0), description="m above ground, of starts and goals")
    apart: float = Field(4.0, ge=0.5, le=50.0, description="m between any two starts, and any two goals")
    clear: float = Field(
        3.5, ge=0.0, le=50.0, description="m from starts, goals and circles to the surface of obstacles"
    )
    gap: float = Field(3.0, ge=0.0, le=50.0, description="m between the surfaces of obstacles")
    spheres: Balls | None = None
    posts: Poles | None = None
    boxes: Blocks | None = None
    jumps: Jumps | None = Field(None, description="of the target, in an escort")
    trouble: Trouble | None = Field(None, description="random disturbances")
    scenario: dict[str, JsonValue] = Field({}, description="other values of the drawn scenarios")

    @model_validator(mode="after")
    def _consistent(self) -> Scene:
        scene_parameters: list[tuple[str, Density | Speed | PerVehicle | Count | Distance]] = [
            ("density", self.density),
            ("speed", self.speed),
        ]
        spans: list[tuple[str, tuple[float, float]]] = [("vehicles", self.vehicles), ("height", self.height)]
        for name, kind in (("spheres", self.spheres), ("posts", self.posts), ("boxes", self.boxes)):
            if kind is not None:
                if kind.per_vehicle is not None:
                    scene_parameters.append((f"{name}.per_vehicle", kind.per_vehicle))
                if kind.count is not None:
                    spans.append((f"{name}.count", kind.count))
                width = ("size", kind.size) if isinstance(kind, Blocks) else ("radius", kind.radius)
                spans += [(f"{name}.{one}", span) for one, span in (width, ("height", kind.height))]
        if self.jumps is not None:
            scene_parameters += [("jumps.count", self.jumps.count), ("jumps.length", self.jumps.length)]
            if self.jumps.every_s.hard > self.jumps.every_s.easy:
                raise ValueError("jumps.every_s: hard must not be longer than easy")
        for name, dial in scene_parameters:
            if dial.hard < dial.easy:
                raise ValueError(f"{name}: hard must not be less than easy")
        for name, span in spans:
            if span[1] < span[0]:
                raise ValueError(f"{name}: the second must not be less than the first")
        if (self.jumps is not None) != (self.task == "escort"):
            raise ValueError("jumps belong to task 'escort', and task 'escort' needs them")
        for key in leaves(self.scenario):
            for decided in DECIDED:
                if f"{key}.".startswith(f"{decided}."):
                    raise ValueError(f"scenario: {decided} is for the scene to decide; it cannot be given")
        return self
