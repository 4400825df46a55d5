"""Settings of obstacles: fixed, moving, detected by sensors, and other traffic."""

from __future__ import annotations

from math import atan2, degrees, hypot, inf
from typing import Annotated, Literal

from pydantic import Field, model_validator

from companion.values.settings import Positive, Settings

_Age = Annotated[int, Field(gt=0, le=60_000_000)]
_Duration = Annotated[int, Field(ge=0, le=60_000_000)]
_Coordinate = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]


_MOST_M = 1000.0
Size = Annotated[float, Field(gt=0.0, le=_MOST_M)]
MOST_OBSTACLES = 20_000
"""Largest number of fixed obstacles."""


class Sphere(Settings):
    """Ball."""

    kind: Literal["sphere"]
    at: tuple[_Coordinate, _Coordinate, _Coordinate] = Field(description="centre, m, fleet-local ENU")
    radius: Size = Field(description="m")


class Post(Settings):
    """Vertical cylinder without a lower end; its top is at ``height``."""

    kind: Literal["post"]
    at: tuple[_Coordinate, _Coordinate] = Field(description="axis, m east and north of the fleet origin")
    radius: Size = Field(description="m")
    height: Size = Field(100.0, description="m above the fleet origin")

    @property
    def endless(self) -> Post:
        """The same post without a top, as planes of committed plans take it."""
        return self.model_copy(update={"height": inf})


class Box(Settings):
    """Box with vertical sides; it hides what is behind it, and may stand on the ground or hang."""

    kind: Literal["box"]
    at: tuple[_Coordinate, _Coordinate, _Coordinate] = Field(description="centre, m, fleet-local ENU")
    size: tuple[Size, Size, Size] = Field(
        description="m: length along its own x and y axes, which ``yaw_deg`` turns, and height"
    )
    yaw_deg: float = Field(
        0.0, ge=-360.0, le=360.0, description="degrees from east to its x axis, positive towards north"
    )


class Wall(Settings):
    """Upright wall on the ground between two places, with flat ends: a box."""

    kind: Literal["wall"]
    ends: tuple[tuple[_Coordinate, _Coordinate], tuple[_Coordinate, _Coordinate]] = Field(
        description="middles of its two ends, m east and north of the fleet origin"
    )
    thickness: Size = Field(0.2, description="m")
    height: Size = Field(100.0, description="m above the fleet origin; its lower end is at 0")

    @model_validator(mode="after")
    def _check_length(self) -> Wall:
        (x0, y0), (x1, y1) = self.ends
        length = hypot(x1 - x0, y1 - y0)
        if not 0.0 < length <= _MOST_M:
            raise ValueError(f"ends are {length:g} m apart; allowed: more than 0, up to {_MOST_M:g} m")
        return self

    @property
    def box(self) -> Box:
        """The same obstacle as a box."""
        (x0, y0), (x1, y1) = self.ends
        return Box(
            kind="box",
            at=(0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * self.height),
            size=(hypot(x1 - x0, y1 - y0), self.thickness, self.height),
            yaw_deg=degrees(atan2(y1 - y0, x1 - x0)),
        )


Obstacle = Annotated[Sphere | Post | Box | Wall, Field(discriminator="kind")]


class _Moving(Settings):
    system: int = Field(ge=1, le=254, description="system id of its messages")


class MovingSphere(_Moving):
    """Moving ball; its reported position is its centre."""

    kind: Literal["sphere"]
    radius: Size = Field(description="m")


class MovingPost(_Moving):
    """Moving vertical cylinder without a lower end; its top is at ``height``, its position on its axis."""

    kind: Literal["post"]
    radius: Size = Field(description="m")
    height: Size = Field(100.0, description="m above the fleet origin")


Moving = Annotated[MovingSphere | MovingPost, Field(discriminator="kind")]


class ProximityConfig(Settings):
    """Processing of OBSTACLE_DISTANCE."""

    age_us: _Age = Field(1_000_000, description="µs: a return is removed this long after it was measured")
    delay_us: int = Field(
        50_000,
        ge=0,
        le=1_000_000,
        description="µs: assumed age of a return whose message has no usable time stamp",
    )
    reach: Positive = Field(15.0, description="m: returns further away are ignored")
    spacing: Positive = Field(0.3, description="m: returns nearer to each other than this are one")
    known: float = Field(
        1.0, ge=0.0, le=10.0, description="m: a return nearer than this to a neighbour is ignored"
    )
    most: int = Field(48, ge=1, le=300, description="only the nearest this many returns are used")


_ADDRESSES = 1 << 24


_Address = Annotated[int, Field(ge=0, lt=_ADDRESSES)]


class TrafficConfig(Settings):
    """Processing of ADSB_VEHICLE."""

    radius: Positive = Field(
        30.0, description="m: horizontal distance that vehicles keep from an aircraft's path"
    )
    height_error: float = Field(
        50.0, ge=0.0, le=1000.0, description="m: largest error of an aircraft's reported height"
    )
    ahead_us: _Duration = Field(
        10_000_000, description="µs: length of the extrapolated path that is kept clear"
    )
    age_us: _Duration = Field(
        10_000_000, description="µs: an aircraft is removed this long after its last message"
    )
    reach: Positive = Field(3000.0, description="m, horizontally: aircraft further away are ignored")
    most: int = Field(32, ge=1, le=200, description="only the nearest this many aircraft are used")
    ignore: tuple[_Address, ...] = Field(
        (), max_length=255, description="ICAO addresses of the fleet's own transponders"
    )
