"""World of a comparison: parameters of fixed obstacles that are drawn for each seed."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from outrider.scenarios.part import Length, Part

Place = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]
Corner = tuple[Place, Place]
Count = Annotated[int, Field(ge=0, le=1000)]


class _Scattered(Part):
    """Obstacles scattered at random, with starts and goals free and a way for each vehicle."""

    low: Corner = Field(description="m east and north: lowest corner of where their axes are")
    high: Corner = Field(description="m east and north: highest corner of where their axes are")
    clear: Length = Field(description="m from each start and goal to every surface, at least")
    passable: Length = Field(
        description="m from surfaces that a way of each vehicle keeps at the height of its start; a world"
        " without such ways is drawn again"
    )

    @model_validator(mode="after")
    def _area(self) -> Self:
        if any(low >= high for low, high in zip(self.low, self.high, strict=True)):
            raise ValueError("world: low must lie below high on both axes")
        return self


class Forest(_Scattered):
    """Boxes on the ground, with sides along the axes; they may overlap."""

    kind: Literal["forest"]
    count: Count = Field(description="number of boxes")
    size: tuple[Length, Length, Length] = Field(description="m east, north and up")


class Pillars(_Scattered):
    """Cylinders on the ground, and rings that stand upright, each a chain of balls."""

    kind: Literal["pillars"]
    count: Count = Field(description="number of cylinders")
    radius: tuple[Length, Length] = Field(description="m, least and largest of cylinders; drawn uniformly")
    height: Length = Field(description="m, of cylinders")
    gap: Annotated[float, Field(ge=0.0, le=100.0)] = Field(
        0.0, description="m, least distance between the axes of any two"
    )
    rings: Count = Field(0, description="number of rings")
    ring_radius: tuple[Length, Length] = Field((0.5, 0.7), description="m, least and largest of rings")
    ring_height: tuple[Length, Length] = Field((0.7, 0.8), description="m, of their centres above ground")
    ring_thickness: Length = Field(0.1, description="m, of the balls that a ring is made of")


class Maze(Part):
    """Maze of square cells; closed cells are boxes. The first and last columns have one opening each.

    A cell inside is opened if one of its neighbours is open: no way leads in a circle.
    """

    kind: Literal["maze"]
    columns: int = Field(ge=3, le=51, description="number of cells from west to east")
    rows: int = Field(ge=3, le=51, description="number of cells from south to north")
    cell: Length = Field(description="m, edge of a cell")
    first: Corner = Field(description="m east and north: centre of the cell in the south-west")
    height: Length = Field(description="m, of the boxes")
    closed: tuple[Count, Count] = Field(
        description="fewest and most closed cells; a maze with others is drawn again"
    )


World = Annotated[Forest | Pillars | Maze, Field(discriminator="kind")]
