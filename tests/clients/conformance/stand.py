"""A vehicle as ``outrider sitl`` makes it, and a client that speaks and reads with pymavlink alone."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any, Final

from pymavlink.dialects.v20 import all as dialect

from sitl.vehicle.battery import BatteryConfig
from tests.sitl.autopilot_rig import SITE, Rig
from tests.sitl.mission_client import Way, upload
from tests.sitl.outside_client import Client

SET_MODE, ARM, TAKEOFF, LAND, REPOSITION, START, YAW = 176, 400, 22, 21, 192, 300, 115
SPEED, RTL, LOITER, INTERVAL, FAIL = 178, 20, 17, 511, 420
PX4_MODES: Final = {"hold": (1, 4, 3), "mission": (1, 4, 4), "return": (1, 4, 5), "follow": (1, 4, 8)}
COPTER: Final = {"AUTO": 3, "GUIDED": 4, "LOITER": 5, "RTL": 6, "LAND": 9, "BRAKE": 17}
NAN: Final = math.nan
PHYSICS: Final = ("own", "jsbsim")
"""Every flight is flown with both."""


class Stand(Client):
    """The client; what it knows of the vehicle it has from messages alone."""

    def __init__(self, flavour: str, **settings: Any) -> None:
        battery = BatteryConfig(cells=3 if flavour == "ardupilot" else 4)
        rig = Rig(
            flavour,
            tick=10_000,
            **{"streams": "normal", "response": "firmware", "battery": battery, **settings},
        )
        rig.most = 4
        super().__init__(rig)
        for message_id in (30, 32, 33, 74):
            self.command(INTERVAL, message_id, 100_000)
        self.wait(1.5)

    def last(self, name: str) -> Any:
        """The newest message of a type."""
        for message in reversed(self.received):
            if message.get_type() == name:
                return message
        raise AssertionError(f"no {name}")

    @property
    def position(self) -> tuple[float, float, float]:
        """North, east, down (m)."""
        m = self.last("LOCAL_POSITION_NED")
        return m.x, m.y, m.z

    @property
    def speed(self) -> float:
        """Over ground (m/s)."""
        m = self.last("LOCAL_POSITION_NED")
        return math.hypot(m.vx, m.vy)

    @property
    def heading(self) -> float:
        """Degrees, 0 to 360."""
        return math.degrees(self.last("ATTITUDE").yaw) % 360.0

    @property
    def armed(self) -> bool:
        return bool(self.last("HEARTBEAT").base_mode & 128)

    @property
    def mode(self) -> int:
        return int(self.last("HEARTBEAT").custom_mode)

    def distance(self, place: tuple[float, float, float]) -> float:
        return math.dist(self.position, place)

    def until(
        self,
        holds: Callable[[], bool],
        seconds: float,
        send: Callable[[], Any] | None = None,
        watch: Callable[[], None] | None = None,
    ) -> float:
        """Wait until ``holds``; fail after ``seconds`` of the vehicle's time; return the time it took.

        ``send`` makes a message that is sent at 20 Hz; ``watch`` is called at the same rate.
        """
        since = self.rig.now
        while self.rig.now - since < 1e6 * seconds:
            if holds():
                return 1e-6 * (self.rig.now - since)
            if send is not None:
                self.send(send())
            self.wait(0.05 if send is None else 0.04)
            if watch is not None:
                watch()
        raise AssertionError(f"not within {seconds} s; position {self.position}, mode {self.mode}")

    def held(
        self,
        holds: Callable[[], bool],
        duration: float,
        seconds: float,
        send: Callable[[], Any] | None = None,
    ) -> None:
        """Wait until ``holds`` for ``duration`` without interruption; fail after ``seconds``.

        This is what ``minimum_duration`` means in the waits of ArduPilot's suite.
        """
        since = self.rig.now

        def lasts() -> bool:
            nonlocal since
            if not holds():
                since = self.rig.now
            return self.rig.now - since > 1e6 * duration

        self.until(lasts, seconds, send)

    def stays(self, holds: Callable[[], bool], seconds: float, send: Callable[[], Any] | None = None) -> None:
        """Fail unless ``holds`` for ``seconds``."""
        since = self.rig.now
        while self.rig.now - since < 1e6 * seconds:
            if send is not None:
                self.send(send())
            self.wait(0.05 if send is None else 0.04)
            assert holds(), (self.position, self.speed, self.heading)

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter; the answer has to confirm it."""
        self.send(dialect.MAVLink_param_request_read_message(11, 1, name.encode(), -1))
        kind = self.last("PARAM_VALUE").param_type
        sent = value
        if self.rig.flavour == "px4" and kind != 9:
            (sent,) = struct.unpack("<f", struct.pack("<i", int(value)))
        self.send(dialect.MAVLink_param_set_message(11, 1, name.encode(), sent, kind))
        assert self.last("PARAM_VALUE").param_value == struct.unpack("<f", struct.pack("<f", sent))[0]

    def take_off(self, height: float) -> None:
        """Armed and hovering at ``height`` (m)."""
        if self.rig.flavour == "ardupilot":
            assert self.command(SET_MODE, 1, COPTER["GUIDED"]) == 0
            assert self.command(ARM, 1) == 0
            assert self.command(TAKEOFF, 0, 0, 0, 0, 0, 0, height) == 0
        else:
            assert self.command(ARM, 1) == 0
            assert self.command(TAKEOFF, *[NAN] * 6, SITE.altitude + height) == 0
        self.until(lambda: abs(self.position[2] + height) < 0.5 and self.speed < 0.5, 45.0)
        self.wait(3.0)

    def fly_mission(self, ways: list[Way]) -> None:
        """Upload (after home, for ArduPilot), take off by the mission's own rules."""
        if self.rig.flavour == "ardupilot":
            assert upload(self, [Way(16), *ways]) == 0
            assert self.command(SET_MODE, 1, COPTER["GUIDED"]) == 0
            assert self.command(ARM, 1) == 0
            assert self.command(SET_MODE, 1, COPTER["AUTO"]) == 0
            assert self.command(START) == 0
        else:
            assert upload(self, ways) == 0
            assert self.command(ARM, 1) == 0
            assert self.command(SET_MODE, *PX4_MODES["mission"]) == 0

    def until_disarmed(self, seconds: float) -> None:
        self.until(lambda: not self.armed, seconds)

    def from_home(self) -> float:
        """Horizontal distance from home (m)."""
        return math.hypot(*self.position[:2])


def position_target(x: float, y: float, z: float, yaw: float = 0.0, frame: int = 1, mask: int = 0x9F8) -> Any:
    """A set-point of a position (m) and a yaw (degrees)."""
    return dialect.MAVLink_set_position_target_local_ned_message(
        0, 11, 1, frame, mask, x, y, z, 0, 0, 0, 0, 0, 0, math.radians(yaw), 0
    )


def velocity_target(x: float, y: float, z: float, frame: int = 1, mask: int = 0x9C7) -> Any:
    """A set-point of a velocity (m/s), yaw 0."""
    return dialect.MAVLink_set_position_target_local_ned_message(
        0, 11, 1, frame, mask, 0, 0, 0, x, y, z, 0, 0, 0, 0, 0
    )


def place(north: float, east: float) -> tuple[int, int]:
    """Latitude and longitude (degE7) of a place (m from home)."""
    latitude, longitude, _ = SITE.to_geodetic((east, north, 0.0))
    return round(latitude * 1e7), round(longitude * 1e7)


def reposition(client: Stand, north: float, east: float, height: float) -> int:
    """DO_REPOSITION as COMMAND_INT, with a change of mode; ``height`` above home (m)."""
    x, y = place(north, east)
    found = client.send(
        dialect.MAVLink_command_int_message(11, 1, 6, REPOSITION, 0, 0, -1.0, 1.0, 0.0, NAN, x, y, height)
    )
    (ack,) = [m for m in found if m.get_type() == "COMMAND_ACK"]
    return int(ack.result)
