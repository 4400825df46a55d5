"""One flight with MAVSDK, as its documentation has it: the same for the gRPC API (3.x) and the ctypes API
(4.x), which have the same plugins and differ in how they are reached (``Drone``).

Everything is waited for with an end; what does not come ends the program with what came instead.
"""

from __future__ import annotations

import asyncio
import math
import traceback
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import aclosing
from typing import Any, NamedTuple

from telling import clock, tell

PATIENCE = 30.0
HEIGHT = 3.0
NEAR = 0.2
"""m from a goal."""
WAYPOINT, TAKEOFF, FENCE_CORNER, RALLY = 16, 22, 5001, 5100
"""MAV_CMD of items."""
ABOVE_SEA, ABOVE_HOME = 0, 6
"""MAV_FRAME_GLOBAL, MAV_FRAME_GLOBAL_RELATIVE_ALT_INT."""
DEGREE = 111_200.0
"""m of latitude, near enough."""


class Drone(NamedTuple):
    """One vehicle: its plugins, and the modules with the classes of values that they take.
    ``stream(plugin, name)``: what a plugin tells again and again."""

    action: Any
    info: Any
    mission: Any
    mission_raw: Any
    offboard: Any
    param: Any
    telemetry: Any
    mission_types: Any
    mission_raw_types: Any
    offboard_types: Any
    stream: Callable[[Any, str], AsyncGenerator[Any, None]]


async def told(stream: AsyncGenerator[Any, None], is_it: Callable[[Any], bool], what: str) -> Any:
    """The first value that is as wanted. Raises TimeoutError with the last one."""
    last = None
    try:
        async with asyncio.timeout(PATIENCE), aclosing(stream):
            async for last in stream:
                if is_it(last):
                    return last
    except TimeoutError:
        raise TimeoutError(f"{what} after {PATIENCE:.0f} s: {last}") from None
    raise EOFError(f"{what} has ended")


async def seen(drone: Drone, name: str, is_it: Callable[[Any], bool] = lambda _: True) -> Any:
    """Of telemetry."""
    return await told(drone.stream(drone.telemetry, name), is_it, name)


async def ready(drone: Drone, connected_at: float) -> None:
    """Every health flag, and how long after the vehicle was found it could be armed."""
    health = await seen(drone, "health", lambda health: health.is_armable)
    tell("armable", after=round(clock() - connected_at, 3))
    health = await seen(drone, "health", lambda health: all(vars(health).values()))
    tell("healthy", after=round(clock() - connected_at, 3), flags=health)
    await seen(drone, "health_all_ok", lambda good: good)


async def ask(drone: Drone) -> None:
    """For rates: ArduPilot streams nothing unasked. Each message by one name of what it holds."""
    asked = {
        "health": 2.0,
        "home": 0.5,
        "battery": 1.0,
        "in_air": 4.0,
        "gps_info": 2.0,
        "unix_epoch_time": 1.0,
    }
    asked |= dict.fromkeys(("position", "attitude_euler", "attitude_quaternion"), 4.0)
    asked |= {"position_velocity_ned": 4.0, "fixedwing_metrics": 4.0}
    for name, rate in asked.items():
        await getattr(drone.telemetry, f"set_rate_{name}")(rate)


async def look(drone: Drone) -> Any:
    """Telemetry of every kind that ground stations show; and home."""
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
    return values[names.index("home")]


async def adjust(drone: Drone, integer: tuple[str, int], fraction: tuple[str, float]) -> None:
    """All parameters; an integer and a float set and read back."""
    param, began = drone.param, clock()
    found = await param.get_all_params()
    counts = {"integers": len(found.int_params), "floats": len(found.float_params)}
    tell("parameters", after=round(clock() - began, 3), **counts)
    name, whole = integer
    was = await param.get_param_int(name)
    await param.set_param_int(name, whole)
    tell("integer", name=name, was=was, set=whole, now=await param.get_param_int(name))
    name, value = fraction
    was = await param.get_param_float(name)
    await param.set_param_float(name, value)
    tell("float", name=name, was=was, set=value, now=await param.get_param_float(name))


async def plan(drone: Drone, home: Any, *, ardupilot: bool) -> None:
    """Mission, fence and rally points, up and down again. ArduPilot keeps home as item 0."""
    raw, item = drone.mission_raw, drone.mission_raw_types.MissionItem
    start = item(0, ABOVE_SEA, WAYPOINT, 1, 1, *(0.0,) * 4, *at(home), home.absolute_altitude_m, 0)
    items = [start] if ardupilot else []
    for command, north, east, up in (
        (TAKEOFF, 0.0, 0.0, HEIGHT),
        (WAYPOINT, 5.0, 0.0, HEIGHT),
        (WAYPOINT, 5.0, 5.0, HEIGHT + 1.0),
    ):
        seq = len(items)
        place = at(home, north, east)
        items.append(item(seq, ABOVE_HOME, command, int(seq == 0), 1, *(0.0,) * 4, *place, up, 0))
    corners = [at(home, *offset) for offset in ((-50.0, -50.0), (50.0, 0.0), (-50.0, 50.0))]
    fence = [
        item(seq, ABOVE_SEA, FENCE_CORNER, 0, 1, 3.0, 0.0, 0.0, 0.0, *place, 0.0, 1)
        for seq, place in enumerate(corners)
    ]
    await raw.upload_geofence(fence)
    tell("fence", up=fence, down=await raw.download_geofence())
    points = [item(0, ABOVE_HOME, RALLY, 0, 1, *(0.0,) * 4, *at(home, 10.0, 10.0), 10.0, 2)]
    await raw.upload_rally_points(points)
    tell("rally", up=points, down=await raw.download_rallypoints())
    await raw.upload_mission(items)
    tell("mission", up=items, down=await raw.download_mission())


def at(home: Any, north: float = 0.0, east: float = 0.0) -> tuple[int, int]:
    """Latitude and longitude (degE7) of a place some metres from home."""
    latitude, longitude = home.latitude_deg, home.longitude_deg
    longitude += east / DEGREE / math.cos(math.radians(latitude))
    return round((latitude + north / DEGREE) * 1e7), round(longitude * 1e7)


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


async def steer(drone: Drone, home: Any) -> None:
    """Offboard by position, velocity, both, a place on earth, each until the vehicle is seen to do so;
    then to a place by command."""
    types, offboard = drone.offboard_types, drone.offboard
    goal = types.PositionNedYaw(4.0, 2.0, -HEIGHT - 1.0, 90.0)
    await offboard.set_position_ned(goal)
    await offboard.start()
    mode = await seen(drone, "flight_mode", lambda mode: mode.name == "OFFBOARD")
    there = await seen(drone, "position_velocity_ned", lambda state: missed(state, goal) < NEAR)
    attitude = await seen(drone, "attitude_euler", lambda angles: abs(angles.yaw_deg - 90.0) < 3.0)
    tell("by position", goal=goal, position=there.position, yaw_deg=attitude.yaw_deg, mode=mode)

    wanted = types.VelocityNedYaw(1.0, -1.0, 0.0, 90.0)
    await offboard.set_velocity_ned(wanted)
    moving = await seen(drone, "velocity_ned", lambda v: _differs(v, wanted) < 0.15)
    tell("by velocity", wanted=wanted, velocity=moving)
    # Forward is east by now.
    await offboard.set_velocity_body(types.VelocityBodyYawspeed(1.0, 0.0, 0.0, 0.0))
    wanted = types.VelocityNedYaw(0.0, 1.0, 0.0, 90.0)
    moving = await seen(drone, "velocity_ned", lambda v: _differs(v, wanted) < 0.15)
    tell("by body velocity", wanted=wanted, velocity=moving)

    still = types.VelocityNedYaw(0.0, 0.0, 0.0, 0.0)
    goal = types.PositionNedYaw(0.0, 0.0, -HEIGHT, 0.0)
    await offboard.set_position_velocity_ned(goal, still)
    there = await seen(drone, "position_velocity_ned", lambda state: missed(state, goal) < NEAR)
    tell("by both", goal=goal, position=there.position, active=await offboard.is_active())

    latitude, longitude = (part / 1e7 for part in at(home, 3.0, -2.0))
    kind = types.PositionGlobalYaw.AltitudeType.REL_HOME
    await offboard.set_position_global(types.PositionGlobalYaw(latitude, longitude, HEIGHT, 0.0, kind))
    goal = types.PositionNedYaw(3.0, -2.0, -HEIGHT, 0.0)
    there = await seen(drone, "position_velocity_ned", lambda state: missed(state, goal) < NEAR)
    tell("by place", goal=goal, position=there.position)

    await offboard.stop()
    mode = await seen(drone, "flight_mode", lambda mode: mode.name != "OFFBOARD")
    tell("stopped", mode=mode, active=await offboard.is_active())

    latitude, longitude = (part / 1e7 for part in at(home, 0.0, 2.0))
    await drone.action.goto_location(latitude, longitude, home.absolute_altitude_m + HEIGHT, 0.0)
    goal = types.PositionNedYaw(0.0, 2.0, -HEIGHT, 0.0)
    there = await seen(drone, "position_velocity_ned", lambda state: missed(state, goal) < NEAR)
    tell("by command", goal=goal, position=there.position)


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


async def follow_plan(drone: Drone) -> None:
    """The mission that is there, from the air, to its end."""
    await drone.mission_raw.start_mission()
    mode = await seen(drone, "flight_mode", lambda mode: mode.name == "MISSION")
    progress = await told(
        drone.stream(drone.mission_raw, "mission_progress"), lambda p: p.current >= p.total > 0, "progress"
    )
    position = await seen(drone, "position_velocity_ned", lambda state: state.position.east_m > 3.0)
    tell("mission flown", mode=mode, progress=progress, position=position.position)


async def land(drone: Drone) -> None:
    """Down, until it has disarmed itself; then disarming has nothing to do and must not fail."""
    await drone.action.land()
    mode = await seen(drone, "flight_mode", lambda mode: mode.name == "LAND")
    await seen(drone, "landed_state", lambda state: state.name == "ON_GROUND")
    await seen(drone, "armed", lambda armed: not armed)
    await drone.action.disarm()
    tell("landed", mode=mode, position=await seen(drone, "position"))


async def fly(drone: Drone, flavour: str, connected_at: float) -> None:
    """All of it."""
    ardupilot = flavour == "ardupilot"
    if ardupilot:
        await ask(drone)
    await ready(drone, connected_at)
    home = await look(drone)
    if ardupilot:
        await adjust(drone, ("LAND_SPEED", 150), ("WPNAV_SPEED", 400.0))
    else:
        await adjust(drone, ("COM_DL_LOSS_T", 12), ("MPC_LAND_SPEED", 1.5))
    await plan(drone, home, ardupilot=ardupilot)
    await take_off(drone)
    await steer(drone, home)
    await follow_plan(drone)
    await land(drone)


async def hop(drone: Drone, flavour: str, connected_at: float) -> None:
    """Up and down; who it was stands in its hardware uid."""
    if flavour == "ardupilot":
        await ask(drone)
    await ready(drone, connected_at)
    identity = await drone.info.get_identification()
    await take_off(drone)
    await land(drone)
    tell("hopped", uid=identity.hardware_uid)


def run(flight: Callable[[], Awaitable[None]]) -> int:
    """The program's exit status; a failure is told as well."""
    try:
        asyncio.run(flight())
    except Exception as error:
        traceback.print_exc()
        tell("failed", error=type(error).__name__, text=str(error))
        return 1
    tell("done")
    return 0
