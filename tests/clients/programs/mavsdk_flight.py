"""One flight with MAVSDK, as its documentation has it: the same for the gRPC API (3.x) and the ctypes API
(4.x), which have the same plugins and differ in how they are reached (``Drone``).

Everything is waited for with an end; what does not come ends the program with what came instead.
"""

from __future__ import annotations

import asyncio
import math
import sys
import traceback
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any, NamedTuple

from telling import clock, tell

PATIENCE = 30.0
HEIGHT = 4.0
MIXED = ("mission item", "waypoint")
HERE, WAYPOINT, TAKEOFF, LAND = 0, 16, 22, 21
ABOVE_HOME = 6
"""MAV_FRAME_GLOBAL_RELATIVE_ALT_INT."""
FENCE_CORNER, RALLY = 5001, 5100


class Drone(NamedTuple):
    """One vehicle: plugins, and the classes of values that they take. ``watch(name)``: the stream of a kind of
    telemetry."""

    action: Any
    info: Any
    mission_raw: Any
    mission: Any
    offboard: Any
    param: Any
    telemetry: Any
    offboard_types: Any
    mission_types: Any
    RawItem: Callable[..., Any]
    watch: Callable[[str], AsyncIterator[Any]]


async def seen(drone: Drone, name: str, is_it: Callable[[Any], bool] = lambda _: True) -> Any:
    """The first value of a kind of telemetry that is as wanted. Raises TimeoutError with the last one."""
    last = None

    async def wait() -> Any:
        nonlocal last
        async for last in drone.watch(name):
            if is_it(last):
                return last
        raise EOFError(f"{name} has ended")

    try:
        return await asyncio.wait_for(wait(), PATIENCE)
    except TimeoutError:
        raise TimeoutError(f"{name} after {PATIENCE:.0f} s: {last}") from None


async def ready(drone: Drone, connected_at: float) -> None:
    """Every health flag, and how long after the vehicle was found it could be armed."""
    health = await seen(drone, "health", lambda health: health.is_armable)
    tell("armable", after=round(clock() - connected_at, 3))
    health = await seen(drone, "health", lambda health: all(vars(health).values()))
    tell("healthy", after=round(clock() - connected_at, 3), flags=health)
    await seen(drone, "health_all_ok", lambda good: good)


async def look(drone: Drone) -> None:
    """Telemetry of every kind that ground stations show."""
    names = (
        *("position", "home", "attitude_euler", "attitude_quaternion", "velocity_ned", "battery"),
        *("landed_state", "in_air", "armed", "flight_mode", "gps_info", "raw_gps", "heading"),
        *("position_velocity_ned", "attitude_angular_velocity_body", "unix_epoch_time", "fixedwing_metrics"),
    )
    values = await asyncio.gather(*(seen(drone, name) for name in names))
    tell("telemetry", **dict(zip(names, values, strict=True)))
    tell("origin", origin=await drone.telemetry.get_gps_global_origin())
    version = await drone.info.get_version()
    identity = await drone.info.get_identification()
    tell("info", version=version, identity=identity, product=await drone.info.get_product())


async def adjust(drone: Drone, number: str, fraction: str) -> None:
    """All parameters; an integer and a float there and back."""
    began = clock()
    found = await drone.param.get_all_params()
    tell(
        "parameters",
        after=round(clock() - began, 3),
        integers=len(found.int_params),
        floats=len(found.float_params),
    )
    was = await drone.param.get_param_int(number)
    await drone.param.set_param_int(number, was + 1)
    tell("integer", was=was, now=await drone.param.get_param_int(number))
    await drone.param.set_param_int(number, was)
    was = await drone.param.get_param_float(fraction)
    await drone.param.set_param_float(fraction, was + 0.25)
    tell("float", was=was, now=await drone.param.get_param_float(fraction))
    await drone.param.set_param_float(fraction, was)


def raw_plan(drone: Drone, home: Any, *, has_home: bool) -> list[Any]:
    """Up, a few metres north, then east, and down; ArduPilot keeps home as item 0."""
    latitude, longitude = home.latitude_deg, home.longitude_deg
    east = 1.0 / math.cos(math.radians(latitude))
    legs = [(TAKEOFF, 0.0, 0.0, HEIGHT), (WAYPOINT, 8.0, 0.0, HEIGHT), (WAYPOINT, 8.0, 8.0, HEIGHT + 2.0)]
    places = [(ABOVE_HOME, *leg) for leg in legs]
    if has_home:
        places.insert(0, (HERE, WAYPOINT, 0.0, 0.0, home.absolute_altitude_m))
    return [
        drone.RawItem(
            seq,
            frame,
            command,
            int(seq == 0),
            1,
            0.0,
            0.0,
            0.0,
            math.nan if command == TAKEOFF and not has_home else 0.0,
            round((latitude + north / 111_200.0) * 1e7),
            round((longitude + to_east * east / 111_200.0) * 1e7),
            up,
            0,
        )
        for seq, (frame, command, north, to_east, up) in enumerate(places)
    ]


def simple(item: Any) -> list[float | None]:
    """A raw item as numbers that JSON has."""
    fields = (item.seq, item.frame, item.command, item.param1, item.param2, item.param3, item.param4)
    return [None if math.isnan(value) else value for value in (*fields, item.x, item.y, item.z)]


async def plan(drone: Drone, *, has_home: bool) -> None:
    """Mission, fence and rally points, up and down again."""
    home = await seen(drone, "home")
    items = raw_plan(drone, home, has_home=has_home)
    await drone.mission_raw.upload_mission(items)
    back = await drone.mission_raw.download_mission()
    tell("mission", up=[simple(item) for item in items], down=[simple(item) for item in back])

    x, y = items[-1].x, items[-1].y
    corners = [(x, y + 1000), (x + 1000, y), (x, y - 1000)]
    fence = [
        drone.RawItem(seq, 0, FENCE_CORNER, 0, 1, 3.0, 0.0, 0.0, 0.0, *place, 0.0, 1)
        for seq, place in enumerate(corners)
    ]
    await drone.mission_raw.upload_geofence(fence)
    back = await drone.mission_raw.download_geofence()
    tell("fence", up=[simple(item) for item in fence], down=[simple(item) for item in back])
    rally = [drone.RawItem(0, ABOVE_HOME, RALLY, 0, 1, 0.0, 0.0, 0.0, 0.0, x, y, 10.0, 2)]
    await drone.mission_raw.upload_rally_points(rally)
    back = await drone.mission_raw.download_rallypoints()
    tell("rally", up=[simple(item) for item in rally], down=[simple(item) for item in back])


async def take_off(drone: Drone) -> None:
    """Arm, and up to the height that was set."""
    await drone.action.set_takeoff_altitude(HEIGHT)
    asked = await drone.action.get_takeoff_altitude()
    await drone.action.arm()
    await seen(drone, "armed", lambda armed: armed)
    await drone.action.takeoff()
    state = await seen(drone, "landed_state", lambda state: state.name in ("TAKING_OFF", "IN_AIR"))
    await seen(drone, "landed_state", lambda state: state.name == "IN_AIR")
    await seen(drone, "in_air", lambda in_air: in_air)
    position = await seen(drone, "position", lambda p: p.relative_altitude_m > asked - 0.3)
    tell("taken off", asked=asked, state=state, position=position)


async def steer(drone: Drone) -> None:
    """Offboard by position, by velocity, by both; each until the vehicle is seen to follow."""
    types, offboard = drone.offboard_types, drone.offboard
    goal = types.PositionNedYaw(4.0, 2.0, -HEIGHT - 1.0, 90.0)
    await offboard.set_position_ned(goal)
    await offboard.start()
    mode = await seen(drone, "flight_mode", lambda mode: mode.name == "OFFBOARD")
    there = await seen(drone, "position_velocity_ned", lambda state: missed(state, goal) < 0.2)
    attitude = await seen(drone, "attitude_euler", lambda angles: abs(angles.yaw_deg - 90.0) < 3.0)
    tell("by position", goal=goal, position=there.position, yaw_deg=attitude.yaw_deg, mode=mode)

    wanted = types.VelocityNedYaw(1.0, -1.0, 0.0, 90.0)
    await offboard.set_velocity_ned(wanted)
    moving = await seen(drone, "velocity_ned", lambda v: _differs(v, wanted) < 0.15)
    tell("by velocity", wanted=wanted, velocity=moving)

    still = types.VelocityNedYaw(0.0, 0.0, 0.0, 0.0)
    goal = types.PositionNedYaw(0.0, 0.0, -HEIGHT, 0.0)
    await offboard.set_position_velocity_ned(goal, still)
    there = await seen(drone, "position_velocity_ned", lambda state: missed(state, goal) < 0.2)
    tell("by both", goal=goal, position=there.position, active=await offboard.is_active())

    await offboard.stop()
    mode = await seen(drone, "flight_mode", lambda mode: mode.name != "OFFBOARD")
    tell("stopped", mode=mode, active=await offboard.is_active())


def missed(state: Any, goal: Any) -> float:
    """How far (m) from a goal."""
    at = state.position
    return math.dist((at.north_m, at.east_m, at.down_m), (goal.north_m, goal.east_m, goal.down_m))


def _differs(velocity: Any, wanted: Any) -> float:
    """m/s."""
    return math.dist(
        (velocity.north_m_s, velocity.east_m_s, velocity.down_m_s),
        (wanted.north_m_s, wanted.east_m_s, wanted.down_m_s),
    )


async def land(drone: Drone) -> None:
    """Down, until it has disarmed itself; then disarming has nothing to do and must not fail."""
    await drone.action.land()
    mode = await seen(drone, "flight_mode", lambda mode: mode.name == "LAND")
    await seen(drone, "landed_state", lambda state: state.name == "ON_GROUND")
    await seen(drone, "armed", lambda armed: not armed)
    await drone.action.disarm()
    position = await seen(drone, "position")
    tell("landed", mode=mode, position=position)


async def fly(drone: Drone, flavour: str, connected_at: float) -> None:
    """All of it."""
    ardupilot = flavour == "ardupilot"
    await ready(drone, connected_at)
    await look(drone)
    await adjust(drone, *(("FS_THR_ENABLE", "WPNAV_SPEED") if ardupilot else ("COM_DL_LOSS_T", "EKF2_REQ_EPH")))
    await plan(drone, has_home=ardupilot)
    await take_off(drone)
    await steer(drone)
    await land(drone)


def run(flight: Callable[[], Awaitable[None]]) -> int:
    """The program's exit status; a failure is told as well."""
    try:
        asyncio.run(flight())
    except Exception as error:
        traceback.print_exc(file=sys.stderr)
        tell("failed", error=type(error).__name__, text=str(error))
        return 1
    tell("done")
    return 0
