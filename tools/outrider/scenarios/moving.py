"""Moving obstacles of a scenario."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from companion.config.companion import Moving, MovingPost, MovingSphere
from outrider.scenarios.part import FIRST_MOVING, FIRST_SYSTEM, Coordinate, Length, Part, Position


class _Moving(Part):
    """Obstacle that follows a smooth closed path from the goal event on and does not give way."""

    radius: Length = Field(description="m")
    speed: float = Field(gt=0.0, le=20.0, description="m/s, after the acceleration")
    setting_out: float = Field(1.0, gt=0.0, le=10.0, description="m/s², until it has its speed")
    rate_hz: float = Field(10.0, gt=0.0, le=50.0, description="rate of its position messages")
    shares_plan: bool = Field(False, description="whether it also sends its trajectory of the next 1.6 s")


class MovingSpherePart(_Moving):
    """A ball."""

    kind: Literal["sphere"]
    through: tuple[Position, ...] = Field(
        min_length=3, max_length=100, description="m, ENU; its centre, in this order, round and round"
    )

    @property
    def places(self) -> NDArray[np.float64]:
        """Points of its path (n, 3), m, ENU."""
        return np.array(self.through)

    def known_as(self, system: int) -> Moving:
        """Return the obstacle as companions are configured with it."""
        return MovingSphere(kind="sphere", system=system, radius=self.radius)


class MovingPostPart(_Moving):
    """A vertical cylinder from below up to ``height``."""

    kind: Literal["post"]
    through: tuple[tuple[Coordinate, Coordinate], ...] = Field(
        min_length=3,
        max_length=100,
        description="m east and north; its axis, in this order, round and round",
    )
    height: Length = Field(100.0, description="m above the fleet origin")

    @property
    def places(self) -> NDArray[np.float64]:
        """Points of its path (n, 3) on the ground, m, ENU."""
        return np.array([(*place, 0.0) for place in self.through])

    def known_as(self, system: int) -> Moving:
        """Return the obstacle as companions are configured with it."""
        return MovingPost(kind="post", system=system, radius=self.radius, height=self.height)


MovingPart = Annotated[MovingSpherePart | MovingPostPart, Field(discriminator="kind")]


def clashes(moving: Sequence[Moving], fleet: range, target: int, known: Sequence[Moving]) -> Iterator[str]:
    """Yield a sentence for each system id of an obstacle that is in use already.

    If the ids of ``fleet`` reach those of moving obstacles, a sentence states the largest fleet. ``moving``
    are the obstacles that the scenario flies, ``known`` the other ones that the companions are configured
    with.
    """
    if moving and fleet[-1] >= FIRST_MOVING:
        most = FIRST_MOVING - FIRST_SYSTEM
        yield f"vehicles and bystanders are {len(fleet)}; with moving obstacles at most {most} are allowed"
    whose = {one.system: f"moving[{k}], which companions know" for k, one in enumerate(moving)}
    if target in whose:
        yield f"target.system = {target} is the id of moving[{target - FIRST_MOVING}]"
    whose |= dict.fromkeys(fleet, "a vehicle of the fleet") | {target: "the target"}
    for index, one in enumerate(known):
        if one.system in whose:
            yield f"companion.moving[{index}].system = {one.system} is the id of {whose[one.system]}"
