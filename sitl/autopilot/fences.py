"""Fences: the limits of flight, and the detection of breaches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Vector
from sitl.autopilot.missions.items import CIRCLES, POLYGONS, Item, Type
from sitl.autopilot.missions.plans import Plans
from sitl.values.home import Home
from sitl.values.origin import Origin

Point = tuple[float, float]
_INCLUSIONS: Final = (
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
)


class Breach(IntEnum):
    """Values of FENCE_BREACH."""

    NONE = mavlink.FENCE_BREACH_NONE
    TOO_LOW = mavlink.FENCE_BREACH_MINALT
    TOO_HIGH = mavlink.FENCE_BREACH_MAXALT
    BOUNDARY = mavlink.FENCE_BREACH_BOUNDARY


class Rules(NamedTuple):
    """Interpretation of fences by a firmware.

    ``any_area``: the vehicle must be inside at least one of the inclusion areas (PX4); if False, inside
    all. ``areas``: whether uploaded polygons and circles are checked. ``floor`` and ``height`` (m above home)
    and ``radius`` (m around home) are infinite where there is no limit.
    """

    enabled: bool
    any_area: bool
    height: float
    radius: float
    action: str
    areas: bool = True
    floor: float = -math.inf


class _Area(NamedTuple):
    """Polygon, or circle around its only corner; local NED, m."""

    corners: tuple[Point, ...]
    radius: float
    stay_in: bool

    def holds(self, x: float, y: float) -> bool:
        """Return whether (x, y) (m) is inside."""
        if self.radius:
            return math.dist(self.corners[0], (x, y)) <= self.radius
        inside = False
        for (ax, ay), (bx, by) in zip(self.corners, self.corners[1:] + self.corners[:1], strict=True):
            # A ray to the north crosses the edge.
            if (ay > y) != (by > y) and x < ax + (bx - ax) * (y - ay) / (by - ay):
                inside = not inside
        return inside


_NO_ITEMS: Final[tuple[Item, ...]] = ()


class Fences:
    """Fence areas of ``plans``, and a cylinder around home."""

    def __init__(self, plans: Plans, origin: Origin, home: Home) -> None:
        self._plans = plans
        self._origin = origin
        self._home = home
        self._items = _NO_ITEMS
        self._areas: tuple[_Area, ...] = ()

    @property
    def uploaded(self) -> bool:
        """Whether a fence has been uploaded; a return point alone counts too."""
        return bool(self._plans.items(Type.FENCE))

    def breach(self, position: Vector, rules: Rules) -> Breach:
        """Return the first limit that ``position`` (m, local NED) exceeds, height first, or NONE."""
        x, y, z = position
        if -z - self._home.height > rules.height:
            return Breach.TOO_HIGH
        if -z - self._home.height < rules.floor:
            return Breach.TOO_LOW
        if math.dist(self._home.position[:2], (x, y)) > rules.radius:
            return Breach.BOUNDARY
        areas = self._parsed() if rules.areas else ()
        within = [area.holds(x, y) for area in areas if area.stay_in]
        kept_in = not within or (any(within) if rules.any_area else all(within))
        kept_out = not any(area.holds(x, y) for area in areas if not area.stay_in)
        return Breach.NONE if kept_in and kept_out else Breach.BOUNDARY

    def _parsed(self) -> tuple[_Area, ...]:
        items = self._plans.items(Type.FENCE)
        if items is not self._items:
            self._items, self._areas = items, tuple(self._parse(items))
        return self._areas

    def _parse(self, items: Sequence[Item]) -> list[_Area]:
        areas: list[_Area] = []
        at = 0
        while at < len(items):
            item, count = items[at], 1
            stay_in = item.command in _INCLUSIONS
            if item.command in POLYGONS:
                count = int(item.params[0])
                corners = tuple(self._point(corner) for corner in items[at : at + count])
                areas.append(_Area(corners, 0.0, stay_in))
            elif item.command in CIRCLES:
                areas.append(_Area((self._point(item),), item.params[0], stay_in))
            at += count
        return areas

    def _point(self, item: Item) -> Point:
        x, y, _ = self._origin.local(item.x / 1e7, item.y / 1e7, self._origin.altitude)
        return x, y
