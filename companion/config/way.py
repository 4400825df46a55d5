"""Settings of ways over fixed obstacles."""

from __future__ import annotations

from pydantic import Field

from companion.values.settings import Settings


class WayConfig(Settings):
    """Way to a destination that fixed obstacles hide: its grid, and the room that it keeps."""

    clearance: float = Field(
        1.0,
        ge=0.0,
        le=20.0,
        description="m that a way keeps beyond the least distance from surfaces, where there is room; without"
        " such a way half of it, and then nothing",
    )
    cell: float = Field(0.5, ge=0.1, le=10.0, description="m, edge of the cells of the grid")
    most_cells: int = Field(
        150_000, ge=1_000, le=2_000_000, description="larger cells are used where the box would hold more"
    )
    lanes: float | None = Field(
        None,
        ge=0.1,
        le=20.0,
        description="m, distance of the places of a lattice on which vehicles that meet in a lane which they"
        " cannot share give way to each other, the smaller id first; a little more than the least distance of"
        " two plans; with committed plans that are planar; null: they do not",
    )
    parts: int = Field(
        10,
        ge=1,
        le=1_000,
        description="parts of a search that are done for each plan, of 0.1 to 1 ms on a PC; twice as many for"
        " a committed plan",
    )
