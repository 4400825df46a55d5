"""One item of a mission, a fence or a list of rally points, and the conditions for its acceptance."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Final, NamedTuple


class Type(IntEnum):
    """Values of MAV_MISSION_TYPE."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


ALL: Final = 255

# MAV_MISSION_RESULT
ACCEPTED: Final = 0
ERROR: Final = 1
UNSUPPORTED_FRAME: Final = 2
UNSUPPORTED: Final = 3
NO_SPACE: Final = 4
INVALID: Final = 5
INVALID_PARAM: Final = (6, 7, 8, 9, 10, 11, 12)
"""Results for parameters 1 to 7."""
INVALID_SEQUENCE: Final = 13
DENIED: Final = 14
CANCELLED: Final = 15

# MAV_CMD
WAYPOINT: Final = 16
LOITER_UNLIMITED: Final = 17
LOITER_TIME: Final = 19
RETURN: Final = 20
LAND: Final = 21
TAKEOFF: Final = 22
DELAY: Final = 93
JUMP: Final = 177
CHANGE_SPEED: Final = 178
FLOWN: Final = frozenset((WAYPOINT, LOITER_UNLIMITED, LOITER_TIME, RETURN, LAND, TAKEOFF, DELAY))
"""NAV commands: items that take time."""
# Commands for cameras and gimbals, which do not exist: accepted as by real firmwares, and skipped.
_PAYLOAD: Final = frozenset((203, 205, 206, 530, 1000, 1001, 2000, 2001, 2500, 2501))
_PLACED: Final = FLOWN - {RETURN, DELAY}
# Fence: return point, inclusion and exclusion polygons, inclusion and exclusion circles
_FENCE_RETURN, _POLYGONS, _CIRCLES = 5000, (5001, 5002), (5003, 5004)
_RALLY: Final = 5100

# MAV_FRAME: above mean sea level, above home; with float and integer coordinates
ABOVE_SEA: Final = frozenset((0, 5))
ABOVE_HOME: Final = frozenset((3, 6))

NOWHERE: Final = 0x7FFFFFFF
_LAST: Final = 900_000_000, 1_800_000_000
_HIGHEST: Final = 10_000.0
_LONGEST: Final = 86_400.0
_FEWEST: Final = 3


class Item(NamedTuple):
    """One item as in MISSION_ITEM_INT (73): ``x``, ``y`` in degE7, ``z`` in m above the frame's reference."""

    frame: int
    command: int
    autocontinue: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float

    @property
    def here(self) -> bool:
        """Whether it gives no place, and so means the vehicle's position."""
        return self.x == self.y == 0 or NOWHERE in (self.x, self.y)


def fault(item: Item, of: Type) -> int:
    """Return the MAV_MISSION_RESULT that refuses ``item`` in a plan of type ``of``, or ACCEPTED."""
    if of is Type.MISSION:
        return _mission_fault(item)
    known = (_RALLY,) if of is Type.RALLY else (_FENCE_RETURN, *_POLYGONS, *_CIRCLES)
    if item.command not in known:
        return UNSUPPORTED
    first = item.params[0]
    if item.command in _POLYGONS and not _FEWEST <= first <= 0xFFFF:
        return INVALID_PARAM[0]
    if item.command in _CIRCLES and not 0.0 < first < math.inf:
        return INVALID_PARAM[0]
    return _place_fault(item)


def whole_fault(items: tuple[Item, ...], of: Type) -> int:
    """Return the MAV_MISSION_RESULT of the checks that need all items of a plan, or ACCEPTED."""
    at = 0
    while at < len(items):
        item = items[at]
        if of is Type.MISSION and item.command == JUMP and not 0 <= item.params[0] < len(items):
            return INVALID_PARAM[0]
        if of is Type.FENCE and item.command in _POLYGONS:
            corners = items[at : at + int(item.params[0])]
            if len(corners) < item.params[0] or any(
                (corner.command, corner.params[0]) != (item.command, item.params[0]) for corner in corners
            ):
                return INVALID_PARAM[0]
            at += len(corners)
            continue
        at += 1
    return ACCEPTED


def _mission_fault(item: Item) -> int:
    command, first, second = item.command, *item.params[:2]
    if command not in FLOWN and command not in (JUMP, CHANGE_SPEED) and command not in _PAYLOAD:
        return UNSUPPORTED
    if command in (WAYPOINT, LOITER_TIME, DELAY) and not (math.isnan(first) or 0.0 <= first <= _LONGEST):
        return INVALID_PARAM[0]
    if command == JUMP and not abs(second) <= 0x7FFF:
        return INVALID_PARAM[1]
    if command == CHANGE_SPEED and not (math.isnan(second) or abs(second) <= 1000.0):
        return INVALID_PARAM[1]
    return _place_fault(item) if command in _PLACED else ACCEPTED


def _place_fault(item: Item) -> int:
    if item.frame not in ABOVE_SEA | ABOVE_HOME:
        return UNSUPPORTED_FRAME
    if item.command not in (TAKEOFF, LAND) or not item.here:
        if abs(item.x) > _LAST[0]:
            return INVALID_PARAM[4]
        if abs(item.y) > _LAST[1]:
            return INVALID_PARAM[5]
    # The height may be NaN only for a landing, which does not use it.
    if not abs(item.z) <= _HIGHEST and not (item.command == LAND and math.isnan(item.z)):
        return INVALID_PARAM[6]
    return ACCEPTED
