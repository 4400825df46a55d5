"""What a vehicle does that set-points do not steer, or that is about to land."""

from __future__ import annotations

from enum import Enum


class Stance(Enum):
    """Stance of a vehicle to its column of air.

    ``PARKED``: it stands on the ground. ``JOINS``: it stands there and is ready to take off. ``CLIMBS``: its
    autopilot takes it off. ``LOWERS``: it hovers and is to land. ``FREE``: none of these.
    """

    PARKED = "parked"
    JOINS = "joins"
    CLIMBS = "climbs"
    LOWERS = "lowers"
    FREE = "free"

    @property
    def grounded(self) -> bool:
        """Whether the vehicle stands on the ground."""
        return self in (Stance.PARKED, Stance.JOINS)
