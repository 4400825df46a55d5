"""Commands that move, stop or hold a flying vehicle, such as DO_REPOSITION."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from sitl.autopilot.command_protocol import Handler, Order
from sitl.autopilot.commander import Commander
from sitl.autopilot.firmware import CommandRefusal, Firmware, Mode
from sitl.autopilot.following import Following
from sitl.autopilot.guidance import Activity, Guidance
from sitl.autopilot.missions.items import Item
from sitl.autopilot.missions.itinerary import Itinerary
from sitl.estimation.sensors import Estimate
from sitl.values.home import ABOVE_HOME, ABOVE_SEA, Home
from sitl.values.origin import Origin

# An air speed is treated as a ground speed, because the speed limits of the guidance ignore the wind.
_HORIZONTAL: Final = (mavlink.SPEED_TYPE_AIRSPEED, mavlink.SPEED_TYPE_GROUNDSPEED)
_VERTICAL: Final = (mavlink.SPEED_TYPE_CLIMB_SPEED, mavlink.SPEED_TYPE_DESCENT_SPEED)
# Values of parameter 2 of DO_CHANGE_SPEED.
_NO_CHANGE, _DEFAULT_SPEED = -1.0, -2.0
_MAX_SPEED: Final = 100.0
_FACED_M: Final = 2.0
"""m: a nearer place is not faced."""
_MAX_LATITUDE_LONGITUDE: Final = (90.0, 180.0)


class Maneuvers:
    """Handlers of commands in flight: ``commands`` by MAV_CMD.

    Commands that a firmware does not support are answered with UNSUPPORTED, as by the real one.
    """

    def __init__(
        self,
        commander: Commander,
        flavour: Firmware,
        guidance: Guidance,
        origin: Origin,
        home: Home,
        itinerary: Itinerary,
        following: Following,
        estimate: Callable[[], Estimate],
        say_doubts: Callable[[int], None],
    ) -> None:
        """``say_doubts`` sends the objections to arming at a time (µs) as texts."""
        self._commander = commander
        self._flavour = flavour
        self._guidance = guidance
        self._origin = origin
        self._home = home
        self._itinerary = itinerary
        self._following = following
        self._estimate = estimate
        self._say_doubts = say_doubts
        self._speed: tuple[Mode, float] | None = None
        self.commands: dict[int, Handler] = {
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: self._loiter,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_DO_FLIGHTTERMINATION: self._terminate,
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_RUN_PREARM_CHECKS: self._check,
        }
        if flavour.stops:
            self.commands |= {
                mavlink.MAV_CMD_DO_FOLLOW: self._follow,
                mavlink.MAV_CMD_CONDITION_YAW: self._turn,
                mavlink.MAV_CMD_DO_PAUSE_CONTINUE: self._pause,
            }

    def _loiter(self, order: Order) -> CommandRefusal | None:
        return self._commander.enter(self._flavour.loiter, order.now)

    def _terminate(self, order: Order) -> CommandRefusal | None:
        if order.params[0] > 0.5:
            self._commander.cut("Flight terminated")
        return None

    def _check(self, order: Order) -> CommandRefusal | None:
        # PX4 runs its checks while armed as well; ArduPilot refuses them.
        if self._commander.armed and self._flavour.stops:
            return CommandRefusal(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "Checks refused: armed")
        self._say_doubts(order.now)
        return None

    def _follow(self, order: Order) -> CommandRefusal | None:
        system = order.params[0]
        if not 1.0 <= system <= 255.0:
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Follow refused: the system id must be 1 to 255")
        self._following.choose(int(system))
        return None

    def _change_speed(self, order: Order) -> CommandRefusal | None:
        """Change the horizontal speed of the present flight and of later DO_REPOSITION flights in this mode.

        In MISSION, the itinerary keeps the speed until the mission begins anew.
        """
        kind, speed = order.params[:2]
        if speed == _NO_CHANGE:
            return None
        if kind in _VERTICAL:
            return CommandRefusal(
                mavlink.MAV_RESULT_UNSUPPORTED, "Speed refused: only the level one can be changed"
            )
        if kind not in _HORIZONTAL or not (speed == _DEFAULT_SPEED or 0.0 < speed <= _MAX_SPEED):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Speed refused: 0 to 100 m/s of kind 0 or 1")
        wanted = None if speed == _DEFAULT_SPEED else speed
        self._speed = None if wanted is None else (self._commander.mode, wanted)
        if self._commander.mode is Mode.MISSION:
            self._itinerary.set_speed(wanted)
        self._guidance.set_speed(self._commander.level_speed if wanted is None else wanted)
        return None

    def _pause(self, order: Order) -> CommandRefusal | None:
        wish = order.params[0]
        if self._commander.mode not in (Mode.MISSION, Mode.GUIDED):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Pause refused: neither in AUTO nor in GUIDED")
        if wish == 0.0:
            if not self._guidance.pause():
                return CommandRefusal(
                    mavlink.MAV_RESULT_FAILED, "Pause refused: neither on the way nor holding"
                )
        elif wish == 1.0:
            self._guidance.go_on()
        else:
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Pause refused: parameter 1 must be 0 or 1")
        return None

    def _turn(self, order: Order) -> CommandRefusal | None:
        """Execute CONDITION_YAW.

        Parameter 1 is the angle (degrees), parameter 4 is 1 if it is relative to the present yaw. Parameter 3
        is the direction of a relative turn: counter-clockwise if negative, else clockwise.
        """
        angle, _, direction, relative = order.params[:4]
        if not (0.0 <= angle <= 360.0 and relative in (0.0, 1.0)):
            return CommandRefusal(
                mavlink.MAV_RESULT_DENIED, "Yaw refused: the angle must be 0 to 360 degrees"
            )
        if self._commander.mode is not Mode.GUIDED or self._guidance.activity is Activity.IDLE:
            return CommandRefusal(mavlink.MAV_RESULT_FAILED, "Yaw refused: not flying in GUIDED")
        turn = math.radians(angle)
        if relative == 1.0:
            turn = self._guidance.yaw + (-turn if direction < 0.0 else turn)
        self._guidance.turn_to(turn)
        return None

    def _reposition(self, order: Order) -> CommandRefusal | None:
        """Execute DO_REPOSITION.

        Parameter 1 is the speed (m/s), bit 0 of parameter 2 whether the mode may change, parameter 4 the yaw
        (rad), parameters 5 to 7 the place.
        """
        commander, guided = self._commander, self._flavour.repositioning
        if not commander.ready:
            return CommandRefusal(
                mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "Reposition refused: no position yet"
            )
        target = self._target(order)
        if isinstance(target, CommandRefusal):
            return target
        flags = order.params[1]
        may_change = math.isfinite(flags) and int(flags) & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
        if commander.mode is not guided:
            if not may_change:
                return CommandRefusal(mavlink.MAV_RESULT_DENIED, f"Reposition refused: not in {guided.name}")
            if refusal := commander.enter(guided, order.now):
                return refusal
        if commander.armed and not commander.landed:
            here = self._estimate().pose
            yaw = self._yaw(order.params[3], target)
            self._guidance.go(target, self._leg_speed(order.params[0]), yaw, here)
        return None

    def go(self, item: Item, now: int) -> bool:
        """Fly to the place of a mission item, as ArduCopter does in GUIDED; return whether it does.

        This is how scripts flew before DO_REPOSITION (DroneKit's ``simple_goto``).
        """
        relative = True if item.frame in ABOVE_HOME else False if item.frame in ABOVE_SEA else None
        if item.command != mavlink.MAV_CMD_NAV_WAYPOINT or relative is None:
            return False
        place = (-1.0, 0.0, 0.0, math.nan, float(item.x), float(item.y), item.z)
        return self._reposition(Order(place, relative, now, integer=True)) is None

    def _target(self, order: Order) -> tuple[float, float, float] | CommandRefusal:
        """Return the target (m, local NED) or the refusal. PX4 takes a NaN coordinate as "unchanged"."""
        latitude, longitude, altitude = order.place
        here = self._estimate().position
        if order.relative is None and self._flavour.stops:
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Reposition refused: this frame is not known")
        if not self._flavour.stops and (order.nowhere or not math.isfinite(latitude + longitude)):
            x, y, level = here[0], here[1], 0.0
        elif (
            not (abs(latitude) <= _MAX_LATITUDE_LONGITUDE[0] and abs(longitude) <= _MAX_LATITUDE_LONGITUDE[1])
            or latitude == longitude == 0.0
        ):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Reposition refused: no such place on the globe")
        else:
            # ``level``: z of that place at the origin's altitude. The Earth's curvature makes it positive.
            x, y, level = self._origin.local(latitude, longitude, self._origin.altitude)
        if not math.isfinite(altitude) and not self._flavour.stops:
            return x, y, here[2]
        if not abs(altitude) <= 10_000.0:
            return CommandRefusal(
                mavlink.MAV_RESULT_DENIED, "Reposition refused: the altitude is out of range"
            )
        above = self._home.altitude if order.relative else 0.0
        return x, y, level - (altitude + above - self._origin.altitude)

    def _leg_speed(self, asked: float) -> float:
        if 0.0 < asked <= _MAX_SPEED:
            return asked
        mode, speed = self._speed or (None, 0.0)
        return speed if mode is self._commander.mode else self._commander.level_speed

    def _yaw(self, asked: float, target: tuple[float, float, float]) -> float | None:
        """Return PX4's parameter 4 (rad), or the direction of an ArduCopter's way; None keeps the heading.

        An ArduCopter faces a way-point (WP_YAW_BEHAVIOR 2, its default), unless it is near.
        """
        if not self._flavour.stops:
            return asked if math.isfinite(asked) else None
        here = self._estimate().position
        north, east = target[0] - here[0], target[1] - here[1]
        return math.atan2(east, north) if math.hypot(north, east) > _FACED_M else None
