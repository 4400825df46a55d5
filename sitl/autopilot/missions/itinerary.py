"""Progress through a mission: the choice of the current item and its execution.

Items that take time (NAV) are flown one after the other. The items between them (DO) are executed at once,
before the next NAV item begins. The guidance moves the vehicle: a waypoint is a destination with a speed, and
is reached when the estimate is within the acceptance radius.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Vector
from sitl.autopilot.guidance import Activity, Guidance
from sitl.autopilot.missions.corners import passing
from sitl.autopilot.missions.items import (
    FLOWN,
    PAUSING,
    Item,
    Type,
)
from sitl.autopilot.missions.plans import Plans
from sitl.config.autopilot import AutopilotConfig
from sitl.estimation.sensors import Estimate
from sitl.values.home import ABOVE_HOME, Home
from sitl.values.origin import Origin

# Height error (m) within which a takeoff counts as completed.
_HEIGHT_TOLERANCE: Final = 0.3
# Distance (m) below which there is no bearing to turn to.
_MIN_BEARING_DISTANCE: Final = 1.0
_FOR_EVER: Final = -1
# An air speed is treated as a ground speed, because the speed limits of the guidance ignore the wind.
_SPEEDS: Final = (mavlink.SPEED_TYPE_AIRSPEED, mavlink.SPEED_TYPE_GROUNDSPEED)


class Phase(Enum):
    """Phase of the current item."""

    IDLE = "idle"
    LIFTING = "lifting"
    GOING = "going"
    WAITING = "waiting"
    LANDING = "landing"
    DONE = "done"


class Event(Enum):
    """Event for the commander."""

    FINISHED = "finished"
    RETURNS = "returns"


class Itinerary:
    """Progress through the mission of ``plans``.

    ``current`` is the item that is flown or will be. ``reached`` collects the completed items until they have
    been reported.
    """

    def __init__(
        self,
        plans: Plans,
        guidance: Guidance,
        home: Home,
        origin: Origin,
        config: AutopilotConfig,
        first: int,
        *,
        px4: bool,
    ) -> None:
        """Set the firmware's mission rules.

        ``first`` is the first item to fly; item 0 is home for ArduPilot. ``px4``: a mission that begins on
        the ground without a takeoff takes off all the same; a waypoint may set its own radius (parameter 2,
        m), and every item that has a place, except a landing, the heading (parameter 4, degrees).
        """
        self._plans = plans
        self._guidance = guidance
        self._home = home
        self._origin = origin
        self._config = config
        self._first = first
        self._px4 = px4
        self._speed: float | None = None
        self._jumps: dict[int, int] = {}
        self._until = 0
        self._target: Vector = (0.0, 0.0, 0.0)
        self.phase = Phase.IDLE
        self.current = first
        self.reached: list[int] = []

    def configure(self, config: AutopilotConfig) -> None:
        """Use new settings from now on."""
        self._config = config

    @property
    def _items(self) -> tuple[Item, ...]:
        return self._plans.items(Type.MISSION)

    @property
    def total(self) -> int:
        """Number of items, without home."""
        return max(0, len(self._items) - self._first)

    @property
    def begun(self) -> bool:
        """Whether progress is beyond the first item."""
        return self.current > self._first

    @property
    def takes_off(self) -> bool:
        """Whether the first item to fly is a takeoff."""
        flown = [item.command for item in self._items[self._first :] if item.command in FLOWN]
        return flown[:1] == [mavlink.MAV_CMD_NAV_TAKEOFF]

    def rewind(self) -> None:
        """Return to the first item; the next ``advance`` begins it."""
        self.phase, self.current = Phase.IDLE, self._first
        self._speed = None
        self._jumps.clear()

    def replaced(self) -> None:
        """Handle the replacement of the mission: begin anew.

        ArduPilot in flight continues with the item of the same number, if the new mission has one.
        """
        if self._px4 or self._guidance.activity is Activity.IDLE or self.current >= len(self._items):
            self.rewind()
        else:
            self.pause()

    def has(self, seq: int) -> bool:
        """Return whether item ``seq`` exists."""
        return 0 <= seq < len(self._items)

    def select(self, seq: int) -> bool:
        """Continue with item ``seq`` at the next ``advance``; return False if it does not exist."""
        if not self.has(seq):
            return False
        self.phase, self.current = Phase.IDLE, max(seq, self._first)
        self._jumps.clear()
        return True

    def set_speed(self, speed: float | None) -> None:
        """Fly at ``speed`` (m/s) from the next item on; None restores the default."""
        self._speed = speed

    def pause(self) -> None:
        """Interrupt the mission; it will resume with the same item."""
        if self.phase is not Phase.DONE:
            self.phase = Phase.IDLE

    def advance(self, now: int, here: Estimate) -> Event | None:
        """Continue the mission; call this in each step at ``now`` (µs) while the mission is flown."""
        match self.phase:
            case Phase.IDLE:
                return self._begin(here)
            case Phase.LIFTING if self._is_high(here):
                return self._fly(here)
            case Phase.GOING if self._is_there(here):
                return self._arrive(now)
            case Phase.WAITING if now >= self._until:
                return self._complete(here)
        return None

    def landed(self) -> None:
        """Complete a landing, after the motors have stopped on the ground."""
        if self.phase is Phase.LANDING:
            self.reached.append(self.current)
            self.phase = Phase.DONE

    # Internals

    def _begin(self, here: Estimate) -> Event | None:
        """Execute the immediate items and start the next item that is flown; FINISHED if there is none."""
        items = self._items
        # A plan of nothing but jumps would loop for ever.
        for _ in range(2 * len(items) + 1):
            if self.current >= len(items):
                break
            item = items[self.current]
            if item.command in FLOWN:
                return self._depart(item, here)
            self._do(item)
        self.phase = Phase.DONE
        return Event.FINISHED

    def _do(self, item: Item) -> None:
        first, second = item.params[:2]
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED and first in _SPEEDS and second > 0.0:
            self._speed = second
        if item.command == mavlink.MAV_CMD_DO_JUMP:
            done = self._jumps.get(self.current, 0)
            if second == _FOR_EVER or done < second:
                self._jumps[self.current] = done + 1
                self.current = max(int(first), self._first)
                return
        self.current += 1

    def _depart(self, item: Item, here: Estimate) -> Event | None:
        guidance = self._guidance
        if guidance.activity is Activity.IDLE and (self._px4 or item.command == mavlink.MAV_CMD_NAV_TAKEOFF):
            height = self._config.takeoff_height + self._home.height
            if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
                height = max(self._height(item), 0.1)
            self._target = (here.position[0], here.position[1], -height)
            guidance.takeoff(height, here.pose)
            self.phase = Phase.LIFTING
            return None
        return self._fly(here)

    def _fly(self, here: Estimate) -> Event | None:
        """Start flying to the current item, in the air."""
        item = self._items[self.current]
        match item.command:
            case mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                self.reached.append(self.current)
                self.phase = Phase.DONE
                return Event.RETURNS
            case mavlink.MAV_CMD_NAV_DELAY:
                self._guidance.hold()
                self._target = here.position
            case _:
                self._target = self._place(item, here)
                speed, yaw = self._leg_speed(here), self._yaw(item, here)
                through = passing(here.position, self._target, self._next_place(here), speed, self._config)
                self._guidance.go(self._target, speed, yaw, here.pose, through)
        self.phase = Phase.GOING
        return None

    def _arrive(self, now: int) -> Event | None:
        item = self._items[self.current]
        pause = item.params[0] if item.command in PAUSING else 0.0
        if item.command == mavlink.MAV_CMD_NAV_LAND:
            self._guidance.land(self._config.land_speed)
            self.phase = Phase.LANDING
        elif item.command != mavlink.MAV_CMD_NAV_LOITER_UNLIM:
            self._until = now + (round(pause * 1e6) if pause > 0.0 else 0)
            self.phase = Phase.WAITING
        return None

    def _complete(self, here: Estimate) -> Event | None:
        self.reached.append(self.current)
        self.current += 1
        event = self._begin(here)
        if event is Event.FINISHED:
            self.current = max(self.current - 1, self._first)
        return event

    def _is_high(self, here: Estimate) -> bool:
        return abs(here.position[2] - self._target[2]) <= _HEIGHT_TOLERANCE

    def _is_there(self, here: Estimate) -> bool:
        item = self._items[self.current]
        if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            return self._is_high(here)
        if item.command == mavlink.MAV_CMD_NAV_LAND:
            # The descent may begin at any height.
            return math.dist(here.position[:2], self._target[:2]) <= min(0.3, self._config.acceptance_radius)
        return math.dist(here.position, self._target) <= self._radius(item)

    def _radius(self, item: Item) -> float:
        own = item.params[1] if self._px4 and item.command == mavlink.MAV_CMD_NAV_WAYPOINT else 0.0
        return own if 0.0 < own < math.inf else self._config.acceptance_radius

    def _height(self, item: Item) -> float:
        """Return the height of an item (m above the origin)."""
        above = self._home.height if item.frame in ABOVE_HOME else -self._origin.altitude
        return item.z + above

    def _place(self, item: Item, here: Estimate) -> Vector:
        """Return the destination of an item (m, local NED)."""
        north, east, down = here.position
        if item.command == mavlink.MAV_CMD_NAV_LAND or item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            if item.here or item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
                # A takeoff in the air climbs or stays.
                if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
                    down = min(down, -self._height(item))
                return north, east, down
            x, y, _ = self._origin.local(item.x / 1e7, item.y / 1e7, self._origin.altitude)
            return x, y, down
        if item.here:
            return north, east, -self._height(item)
        height = self._height(item)
        x, y, z = self._origin.local(item.x / 1e7, item.y / 1e7, self._origin.altitude + height)
        return x, y, z

    def _next_place(self, here: Estimate) -> Vector | None:
        """Return the next waypoint's place if the present one is flown through, else None."""
        follows = self._items[self.current : self.current + 2]
        item = follows[0]
        if any(one.command != mavlink.MAV_CMD_NAV_WAYPOINT or one.here for one in follows):
            return None
        return self._place(follows[1], here) if len(follows) == 2 and not item.params[0] > 0.0 else None

    def _leg_speed(self, here: Estimate) -> float:
        """Return the speed (m/s) along the leg, within the limits of climb and sink rate."""
        speed = self._speed or self._config.waypoint_speed
        length = math.dist(here.position, self._target)
        rise = here.position[2] - self._target[2]
        limit = self._config.waypoint_climb if rise > 0.0 else self._config.waypoint_sink
        speed = min(speed, self._config.max_speed)
        return min(speed, limit * length / abs(rise)) if rise else speed

    def _yaw(self, item: Item, here: Estimate) -> float | None:
        """Return the yaw (rad): PX4's parameter 4 (degrees) if given, else along the leg.

        None, which keeps the yaw, if the leg is horizontally no longer than ``_MIN_BEARING_DISTANCE``.
        """
        if self._px4 and math.isfinite(item.params[3]) and item.command != mavlink.MAV_CMD_NAV_LAND:
            return math.radians(item.params[3])
        north, east = self._target[0] - here.position[0], self._target[1] - here.position[1]
        return math.atan2(east, north) if math.hypot(north, east) > _MIN_BEARING_DISTANCE else None
