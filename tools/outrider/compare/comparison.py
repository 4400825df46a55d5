"""Comparison file: the scene of a published planner, the rows that are flown, and the published figures.

A comparison is data: another scene needs a file beside the shipped ones in ``config/comparisons``, and no
code.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, JsonValue, model_validator

from outrider.compare.world import World
from outrider.scenarios.part import Length, Part, Position, Share
from outrider.sweep.grid import Key

Figure = Annotated[float, Field(ge=0.0, le=1e9)]
Text = Annotated[str, Field(min_length=1, max_length=400)]


class Measure(Part):
    """How the scene's authors measure the distance of two vehicles, and when it is a collision.

    ball: ‖Δ‖; box: the largest of |Δx|, |Δy|, |Δz|; ellipsoid: ‖(Δx, Δy, Δz / downwash)‖.
    """

    kind: Literal["ball", "box", "ellipsoid"] = Field("ball", description="shape of a vehicle: see above")
    least: Length = Field(description="m in that measure; less is a collision")
    downwash: float = Field(1.0, ge=1.0, le=20.0, description="of an ellipsoid: height over width")
    obstacle: Length | None = Field(
        None,
        description="m from a centre to the surface of an obstacle; less is a collision. Null: none counts",
    )

    @model_validator(mode="after")
    def _only_ellipsoids(self) -> Self:
        if (self.kind == "ellipsoid") != (self.downwash > 1.0):
            raise ValueError("measure: kind 'ellipsoid' and a downwash above 1 come together")
        return self


class Missions(Part):
    """Random starts and goals in a box, drawn for each seed: any two are ``apart`` in the measure."""

    low: Position = Field(description="m, ENU: lowest corner")
    high: Position = Field(description="m, ENU: highest corner")
    offset: Position = Field((0.0, 0.0, 0.0), description="m, added to the places of mission files")
    apart: Length = Field(description="m, of any two starts and of any two goals, in the scene's measure")
    near: Length | None = Field(None, description="m, largest distance of a goal from its start; null: any")

    @model_validator(mode="after")
    def _box(self) -> Self:
        if any(low >= high for low, high in zip(self.low, self.high, strict=True)):
            raise ValueError("missions: low must lie below high on every axis")
        return self


class Bar(Part):
    """What a row shall reach, without a violation of its own d_min in any case."""

    mean_s: Figure | None = Field(None, description="s, mean time of arrival at most")
    last_s: Figure | None = Field(None, description="s, last arrival at most, mean over the flights")
    success: Share = Field(1.0, description="share of the flights that succeed, at least")
    plan_ms: Figure | None = Field(None, description="ms, CPU time of a plan at most, median")


class Row(Part):
    """One row: the scene with some values set."""

    label: Text = Field(description="names the row, and the published figures that belong to it")
    set: dict[Key, JsonValue] = Field({}, description="values of the scenario by dotted key")
    world: World | None = Field(None, description="obstacles of this row, in place of the comparison's")
    missions: Missions | None = Field(
        None, description="starts and goals of this row, in place of the comparison's"
    )
    bar: Bar | None = None


class Published(Part):
    """Published figures of one planner in one row; those that were not published are null."""

    planner: Text = Field(description="name of the planner")
    row: Text = Field(description="label of a row of this file")
    success: Share | None = Field(None, description="share of the flights without a collision that arrive")
    mean_s: Figure | None = Field(
        None,
        description="s, mean time of arrival over vehicles, or a mean whose source does not say over what",
    )
    last_s: Figure | None = Field(None, description="s, time until all have arrived, mean over the flights")
    worst_s: Figure | None = Field(None, description="s, longest time")
    path_m: Figure | None = Field(None, description="m, length of a path")
    acceleration2: Figure | None = Field(None, description="m²/s³, ∫a² of a vehicle")
    jerk2: Figure | None = Field(None, description="m²/s⁵, ∫j² of a vehicle")
    stops: Figure | None = Field(None, description="number of stops of a vehicle")
    plan_ms: Figure | None = Field(None, description="ms, time of a plan")
    processor: Text | None = Field(None, description="what worked out the plans, as published")
    runs: int | None = Field(None, ge=1, description="number of flights")
    source: Text = Field(description="where it was published, or read")
    note: str = Field("", max_length=400, description="what to know of these figures")


class Physics(Part):
    """What ``--physics`` flies: the scene with a vehicle in full physics.

    Its distances are its own: two vehicles keep its span, and centres half of it from obstacles.
    """

    vehicle: Text = Field(description="vehicle with rotors, shipped or a file")
    set: dict[Key, JsonValue] = Field(
        {}, description="values of the scenario by dotted key, such as its limits and its tube"
    )
    differences: tuple[Text, ...] = Field(
        (), max_length=50, description="what is not alike only with this vehicle, a sentence each"
    )


class Comparison(Part):
    """Scene of a published planner."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", description="names the output directory")
    description: Text = Field(description="one line for lists and reports")
    scenario: Text = Field(description="scenario file, beside this one")
    measure: Measure
    goal_radius: Length = Field(
        description="m: a vehicle has arrived when it is this near for the first time"
    )
    missions: Missions | None = Field(None, description="null: starts and goals are the scenario's")
    world: World | None = Field(
        None, description="obstacles, drawn for each seed and added to the scenario's; null: none are drawn"
    )
    seeds: int = Field(30, ge=1, le=100_000, description="flights of each row")
    set: dict[Key, JsonValue] = Field({}, description="values of the scenario for all rows, by dotted key")
    rows: tuple[Row, ...] = Field(min_length=1, max_length=100)
    physics: Physics | None = Field(None, description="the scene in full physics; null: for points only")
    published: tuple[Published, ...] = Field((), max_length=500)
    differences: tuple[Text, ...] = Field(
        (), max_length=50, description="what is not alike, with points and in full physics, a sentence each"
    )
    points: tuple[Text, ...] = Field(
        (), max_length=50, description="what else is not alike with points, a sentence each"
    )

    @property
    def unlike(self) -> tuple[str, ...]:
        """What is not alike in the scene that is flown, a sentence each."""
        return (*self.points, *self.differences)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        labels = [row.label for row in self.rows]
        twice = sorted({label for label in labels if labels.count(label) > 1})
        if twice:
            raise ValueError(f"rows: {twice[0]!r} is there twice; allowed: each label once")
        for index, one in enumerate(self.published):
            if one.row not in labels:
                raise ValueError(
                    f"published[{index}].row: there is no row {one.row!r}; rows are {', '.join(labels)}"
                )
        return self
