"""One item of a mission, a fence or a list of rally points, and the conditions for its acceptance."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages.fields import on_globe
from sitl.values.home import ABOVE_HOME, ABOVE_SEA, NOWHERE, Home


class Type(IntEnum):
    """Values of MAV_MISSION_TYPE."""

    MISSION = mavlink.MAV_MISSION_TYPE_MISSION
    FENCE = mavlink.MAV_MISSION_TYPE_FENCE
    RALLY = mavlink.MAV_MISSION_TYPE_RALLY


FLOWN: Final = frozenset(
    (
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_NAV_DELAY,
    )
)
"""NAV commands: items that take time."""
# Commands for cameras and gimbals, which do not exist: accepted as by real firmwares, and skipped.
_PAYLOAD: Final = frozenset(
    (
        mavlink.MAV_CMD_DO_DIGICAM_CONTROL,
        mavlink.MAV_CMD_DO_MOUNT_CONTROL,
        mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
        mavlink.MAV_CMD_SET_CAMERA_MODE,
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
        mavlink.MAV_CMD_IMAGE_START_CAPTURE,
        mavlink.MAV_CMD_IMAGE_STOP_CAPTURE,
        mavlink.MAV_CMD_VIDEO_START_CAPTURE,
        mavlink.MAV_CMD_VIDEO_STOP_CAPTURE,
    )
)
_IMMEDIATE: Final = _PAYLOAD | {mavlink.MAV_CMD_DO_JUMP, mavlink.MAV_CMD_DO_CHANGE_SPEED}
_PLACED: Final = FLOWN - {mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, mavlink.MAV_CMD_NAV_DELAY}
PAUSING: Final = (
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_LOITER_TIME,
    mavlink.MAV_CMD_NAV_DELAY,
)
"""Items whose parameter 1 is a time to wait (s)."""
POLYGONS: Final = (
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
)
CIRCLES: Final = (
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
)
_KNOWN: Final = {
    Type.FENCE: (mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT, *POLYGONS, *CIRCLES),
    Type.RALLY: (mavlink.MAV_CMD_NAV_RALLY_POINT,),
}

_MAX_ALTITUDE: Final = 10_000.0
_MAX_WAIT_S: Final = 86_400.0
_MIN_CORNERS: Final = 3


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
        """Whether the item gives no place, and so means the vehicle's position."""
        return self.x == self.y == 0 or NOWHERE in (self.x, self.y)


def home_item(home: Home) -> Item:
    """Return ArduPilot's item 0: home."""
    x, y = round(home.latitude * 1e7), round(home.longitude * 1e7)
    waypoint, frame = mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_FRAME_GLOBAL
    return Item(frame, waypoint, 1, (0.0, 0.0, 0.0, 0.0), x, y, home.altitude)


def fault(item: Item, of: Type) -> int:
    """Return the MAV_MISSION_RESULT that refuses ``item`` in a plan of type ``of``, or ACCEPTED."""
    return _mission_fault(item) if of is Type.MISSION else _area_fault(item, of)


def whole_fault(items: tuple[Item, ...], of: Type) -> int:
    """Return the MAV_MISSION_RESULT of the checks that need all items of a plan, or ACCEPTED."""
    at = 0
    result: int = mavlink.MAV_MISSION_ACCEPTED
    while at < len(items) and result == mavlink.MAV_MISSION_ACCEPTED:
        item, count = items[at], 1
        jumps = of is Type.MISSION and item.command == mavlink.MAV_CMD_DO_JUMP
        if jumps and not 0 <= item.params[0] < len(items):
            result = mavlink.MAV_MISSION_INVALID_PARAM1
        if of is Type.FENCE and item.command in POLYGONS:
            count = int(item.params[0])
            corners = items[at : at + count]
            if len(corners) < item.params[0] or any(
                (corner.command, corner.params[0]) != (item.command, item.params[0]) for corner in corners
            ):
                result = mavlink.MAV_MISSION_INVALID_PARAM1
        at += count
    return result


def _mission_fault(item: Item) -> int:
    command, first, second = item.command, *item.params[:2]
    result: int = mavlink.MAV_MISSION_ACCEPTED
    if command not in FLOWN | _IMMEDIATE:
        result = mavlink.MAV_MISSION_UNSUPPORTED
    elif command in PAUSING and not (math.isnan(first) or 0.0 <= first <= _MAX_WAIT_S):
        result = mavlink.MAV_MISSION_INVALID_PARAM1
    elif (command == mavlink.MAV_CMD_DO_JUMP and not abs(second) <= 0x7FFF) or (
        command == mavlink.MAV_CMD_DO_CHANGE_SPEED and not (math.isnan(second) or abs(second) <= 1000.0)
    ):
        result = mavlink.MAV_MISSION_INVALID_PARAM2
    elif command in _PLACED:
        result = _place_fault(item)
    return result


def _area_fault(item: Item, of: Type) -> int:
    """Return the fault of an item of a fence, or of a rally point."""
    first = item.params[0]
    result: int
    if item.command not in _KNOWN[of]:
        result = mavlink.MAV_MISSION_UNSUPPORTED
    elif (item.command in POLYGONS and not _MIN_CORNERS <= first <= 0xFFFF) or (
        item.command in CIRCLES and not 0.0 < first < math.inf
    ):
        result = mavlink.MAV_MISSION_INVALID_PARAM1
    else:
        result = _place_fault(item)
    return result


def _place_fault(item: Item) -> int:
    lands = item.command == mavlink.MAV_CMD_NAV_LAND
    placed = not (lands or item.command == mavlink.MAV_CMD_NAV_TAKEOFF) or not item.here
    result: int = mavlink.MAV_MISSION_ACCEPTED
    if item.frame not in ABOVE_SEA | ABOVE_HOME:
        result = mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    elif placed and not on_globe(item.x, 0):
        result = mavlink.MAV_MISSION_INVALID_PARAM5_X
    elif placed and not on_globe(0, item.y):
        result = mavlink.MAV_MISSION_INVALID_PARAM6_Y
    # The height may be NaN only for a landing, which does not use it.
    elif not abs(item.z) <= _MAX_ALTITUDE and not (lands and math.isnan(item.z)):
        result = mavlink.MAV_MISSION_INVALID_PARAM7
    return result
