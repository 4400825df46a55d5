"""Missions as a ground station sends and fetches them, in pymavlink's messages."""

from __future__ import annotations

from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as dialect

from tests.sitl.autopilot_rig import SITE
from tests.sitl.outside_client import Client

WAYPOINT, LOITER_UNLIM, LOITER_TIME, RTL, LAND, TAKEOFF, DELAY = 16, 17, 19, 20, 21, 22, 93
JUMP, SPEED = 177, 178
RELATIVE, MISSION_FRAME = 6, 2


SAID = ("seq", "command", "frame", "autocontinue", "param1", "param2", "param3", "param4", "x", "y", "z")


class Way(NamedTuple):
    """An item as a test writes it."""

    command: int
    x: int = 0
    y: int = 0
    z: float = 0.0
    params: tuple[float, ...] = (0.0, 0.0, 0.0, float("nan"))
    frame: int = RELATIVE


def at(north: float, east: float, up: float, command: int = WAYPOINT, *params: float) -> Way:
    """An item at a place, m from home."""
    latitude, longitude, _ = SITE.to_geodetic((east, north, 0.0))
    values = (*params, *(0.0, 0.0, 0.0, float("nan"))[len(params) :])
    return Way(command, round(latitude * 1e7), round(longitude * 1e7), up, values)


def item(way: Way, seq: int, of: int = 0) -> Any:
    return dialect.MAVLink_mission_item_int_message(
        11, 1, seq, way.frame, way.command, int(seq == 0), 1, *way.params, way.x, way.y, way.z, of
    )


def old_item(way: Way, seq: int, of: int = 0) -> Any:
    x, y = way.x / 1e7, way.y / 1e7
    return dialect.MAVLink_mission_item_message(
        11, 1, seq, 3, way.command, int(seq == 0), 1, *way.params, x, y, way.z, of
    )


def count(total: int, of: int = 0) -> Any:
    return dialect.MAVLink_mission_count_message(11, 1, total, of)


def requests(found: list[Any]) -> list[int]:
    return [m.seq for m in found if m.get_type() in ("MISSION_REQUEST", "MISSION_REQUEST_INT")]


def acks(found: list[Any]) -> list[int]:
    return [m.type for m in found if m.get_type() == "MISSION_ACK"]


def upload(client: Client, ways: list[Way], of: int = 0, *, make: Any = item) -> int:
    """Send a plan as the protocol says; the MAV_MISSION_RESULT at its end."""
    found = client.send(count(len(ways), of))
    for _ in range(len(ways) + 1):
        if results := acks(found):
            return int(results[0])
        (seq,) = requests(found)
        found = client.send(make(ways[seq], seq, of))
    raise AssertionError("no end")


def download(client: Client, of: int = 0) -> list[Any]:
    """Fetch a plan."""
    found = client.send(dialect.MAVLink_mission_request_list_message(11, 1, of))
    (total,) = [m.count for m in found if m.get_type() == "MISSION_COUNT" and m.mission_type == of]
    items = []
    for seq in range(total):
        found = client.send(dialect.MAVLink_mission_request_int_message(11, 1, seq, of))
        items += [m for m in found if m.get_type() == "MISSION_ITEM_INT"]
    client.send(dialect.MAVLink_mission_ack_message(11, 1, 0, of))
    return items


def ways(items: list[Any]) -> list[str]:
    """What items say, so that a NaN is equal to itself; not a mission's item 0, an ArduPilot's home."""
    kept = [m for m in items if (m.seq, m.mission_type) != (0, 0)]
    return [repr([getattr(m, name) for name in SAID]) for m in kept]
