"""A script as pymavlink's users write it: ``pymavlink_flight.py FLAVOUR ENDPOINT``."""

from __future__ import annotations

import math
import statistics
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink
from telling import clock, tell

PATIENCE = 30.0
RATE = 0.05
PERIOD_MS = 50
POSITION_YAW, VELOCITY_YAW, POSITION_VELOCITY_YAW = 0x9F8, 0x9C7, 0x9C0


class Vehicle:
    """One connection to one vehicle."""

    def __init__(self, flavour: str, endpoint: str) -> None:
        self.flavour = flavour
        self.link = mavutil.mavlink_connection(endpoint, source_system=255)

    def wait(self, kind: str, is_it: Callable[[Any], bool] = lambda _: True) -> Any:
        """The next message of a kind that is as wanted. Raises TimeoutError."""
        end, last = clock() + PATIENCE, None
        while (left := end - clock()) > 0:
            message = self.link.recv_match(type=kind, blocking=True, timeout=left)
            last = message or last
            if message is not None and is_it(message):
                return message
        raise TimeoutError(f"{kind} after {PATIENCE:.0f} s: {last}")

    def command(self, command: int, *params: float) -> int:
        """COMMAND_LONG, and its result."""
        self.order(command, *params)
        return int(self.wait("COMMAND_ACK", lambda ack: ack.command == command).result)

    def order(self, command: int, *params: float) -> None:
        """COMMAND_LONG."""
        values = (*params, *([0.0] * 7))[:7]
        link = self.link
        link.mav.command_long_send(link.target_system, link.target_component, command, 0, *values)

    def setpoint(
        self, mask: int, position: tuple[float, ...], velocity: tuple[float, ...], yaw: float
    ) -> None:
        """SET_POSITION_TARGET_LOCAL_NED in the local frame."""
        link = self.link
        link.mav.set_position_target_local_ned_send(
            0, link.target_system, link.target_component, 1, mask, *position, *velocity, 0, 0, 0, yaw, 0
        )

    def steer(
        self,
        mask: int,
        position: tuple[float, ...],
        velocity: tuple[float, ...],
        is_it: Callable[[Any], bool],
    ) -> Any:
        """Send the same set-point at 20 Hz until LOCAL_POSITION_NED is as wanted."""
        end, due = clock() + PATIENCE, 0.0
        while clock() < end:
            if clock() >= due:
                due = clock() + RATE
                self.setpoint(mask, position, velocity, 0.5)
            found = self.link.recv_match(type="LOCAL_POSITION_NED", blocking=True, timeout=RATE)
            if found is not None and is_it(found):
                return found
        raise TimeoutError(f"set-point 0x{mask:X} {position} {velocity}")


def place(message: Any) -> tuple[float, float, float]:
    return message.x, message.y, message.z


def connect(vehicle: Vehicle) -> None:
    """Found, awake, and what was asked for comes at the rate that was asked for."""
    heartbeat = vehicle.link.wait_heartbeat(timeout=PATIENCE)
    at = clock()
    tell("discovered", client=mavutil.mavlink.WIRE_PROTOCOL_VERSION, type=heartbeat.type)
    if vehicle.flavour == "ardupilot":
        # It streams nothing unasked; EXTENDED_SYS_STATE is in none of its groups.
        link = vehicle.link
        link.mav.request_data_stream_send(link.target_system, link.target_component, 0, 4, 1)
        vehicle.order(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 245, 500_000)
    bit = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    vehicle.wait("SYS_STATUS", lambda status: status.onboard_control_sensors_health & bit)
    tell("armable", after=round(clock() - at, 3))

    for name, number in (("AUTOPILOT_VERSION", 148), ("HOME_POSITION", 242), ("GPS_GLOBAL_ORIGIN", 49)):
        vehicle.order(mavlink.MAV_CMD_REQUEST_MESSAGE, number)
        vehicle.wait(name)
    kinds = ("ATTITUDE", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT")
    for number in (30, 32, 33):
        vehicle.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, PERIOD_MS * 1000)
    times: dict[str, list[int]] = {name: [] for name in kinds}
    while min(map(len, times.values())) < 20:
        message = vehicle.wait(list(kinds))
        times[message.get_type()].append(message.time_boot_ms)
    periods = {
        name: statistics.median(later - earlier for earlier, later in pairwise(stamps))
        for name, stamps in times.items()
    }
    tell("rates", asked_ms=PERIOD_MS, periods_ms=periods)
    for name in ("BATTERY_STATUS", "EXTENDED_SYS_STATE", "GPS_RAW_INT", "VFR_HUD", "SYSTEM_TIME"):
        vehicle.wait(name)


def parameters(vehicle: Vehicle, name: str) -> None:
    """All of them, then one changed."""
    link = vehicle.link
    began = clock()
    link.param_fetch_all()
    found = {}
    value = vehicle.wait("PARAM_VALUE")
    while len(found) < value.param_count:
        found[value.param_id] = value.param_value
        if len(found) < value.param_count:
            value = vehicle.wait("PARAM_VALUE")
    tell("parameters", after=round(clock() - began, 3), count=len(found), said=value.param_count)
    was = found[name]
    link.mav.param_set_send(
        link.target_system, link.target_component, name.encode(), was + 0.5, mavlink.MAV_PARAM_TYPE_REAL32
    )
    now = vehicle.wait("PARAM_VALUE", lambda value: value.param_id == name).param_value
    tell("parameter", was=was, now=now)


def rise(vehicle: Vehicle) -> None:
    """Arm and take off: ArduPilot by command in GUIDED, PX4 by set-point in OFFBOARD."""
    link, goal = vehicle.link, (0.0, 0.0, -3.0)
    if vehicle.flavour == "ardupilot":
        link.set_mode("GUIDED")
        vehicle.wait("HEARTBEAT", lambda heartbeat: heartbeat.custom_mode == link.mode_mapping()["GUIDED"])
        link.arducopter_arm()
        link.motors_armed_wait()
        result = vehicle.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 3.0)
        reached = vehicle.wait("LOCAL_POSITION_NED", lambda p: math.dist(place(p), goal) < 0.2)
    else:
        until = clock() + 1.0
        while clock() < until:
            vehicle.setpoint(POSITION_YAW, goal, (0.0, 0.0, 0.0), 0.0)
            time.sleep(RATE)
        link.set_mode("OFFBOARD")
        result = vehicle.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        reached = vehicle.steer(
            POSITION_YAW, goal, (0.0, 0.0, 0.0), lambda p: math.dist(place(p), goal) < 0.2
        )
    tell("taken off", result=result, goal=goal, position=place(reached), mode=link.flightmode)


def steer(vehicle: Vehicle) -> None:
    """By position, by velocity, by both."""
    none = (0.0, 0.0, 0.0)
    goal = (3.0, -2.0, -4.0)
    at = vehicle.steer(POSITION_YAW, goal, none, lambda p: math.dist(place(p), goal) < 0.2)
    tell("by position", goal=goal, position=place(at))
    wanted = (-1.0, 0.5, 0.0)
    at = vehicle.steer(VELOCITY_YAW, none, wanted, lambda p: math.dist((p.vx, p.vy, p.vz), wanted) < 0.15)
    tell("by velocity", wanted=wanted, velocity=(at.vx, at.vy, at.vz))
    goal = (0.0, 0.0, -3.0)
    at = vehicle.steer(POSITION_VELOCITY_YAW, goal, none, lambda p: math.dist(place(p), goal) < 0.2)
    tell("by both", goal=goal, position=place(at), yaw=vehicle.wait("ATTITUDE").yaw)


def land(vehicle: Vehicle) -> None:
    """Down, until it has disarmed itself."""
    vehicle.link.set_mode("LAND")
    vehicle.wait("EXTENDED_SYS_STATE", lambda s: s.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND)
    vehicle.link.motors_disarmed_wait()
    tell("landed", position=place(vehicle.wait("LOCAL_POSITION_NED")))


def main() -> int:
    flavour, endpoint = sys.argv[1:]
    vehicle = Vehicle(flavour, endpoint)
    try:
        connect(vehicle)
        parameters(vehicle, "WPNAV_SPEED" if flavour == "ardupilot" else "EKF2_REQ_EPH")
        rise(vehicle)
        steer(vehicle)
        land(vehicle)
    except TimeoutError as error:
        tell("failed", error="TimeoutError", text=str(error))
        return 1
    tell("done")
    return 0


if __name__ == "__main__":
    sys.exit(main())
