"""Home and origin commands: DO_SET_HOME (179), SET_HOME_POSITION (243), SET_GPS_GLOBAL_ORIGIN (48)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import SetGpsGlobalOrigin, SetHomePosition
from sitl.autopilot.command_protocol import Handler, Order
from sitl.autopilot.firmware import CommandRefusal
from sitl.estimation.sensors import Estimate
from sitl.telemetry.schedule import Telemetry
from sitl.telemetry.status_text import StatusReporter
from sitl.values.home import Home
from sitl.values.origin import Origin

# Greatest accepted distance of home from the origin, and magnitude of its altitude (m).
_MAX_DISTANCE: Final = 100_000.0


class HomeCommands:
    """Handler that moves ``home``, and reports it after every change.

    The origin of the filter is fixed, as on a real ArduPilot that has one; a request to set the origin is
    refused, and answered with the present origin.
    """

    def __init__(
        self,
        home: Home,
        origin: Origin,
        telemetry: Telemetry,
        estimate: Callable[[], Estimate],
        ready: Callable[[], bool],
        status_text: StatusReporter,
    ) -> None:
        """``ready`` returns whether there is a position."""
        self._home = home
        self._origin = origin
        self._telemetry = telemetry
        self._estimate = estimate
        self._ready = ready
        self._status_text = status_text
        self.commands: dict[int, Handler] = {mavlink.MAV_CMD_DO_SET_HOME: self._set_home}

    def set_home(self, message: SetHomePosition, now: int) -> None:
        """Handle SET_HOME_POSITION (243)."""
        refusal = self._move(message.latitude, message.longitude, message.altitude)
        if refusal is not None:
            self._status_text.complain(refusal.reason, now)

    def set_origin(self, _message: SetGpsGlobalOrigin, now: int) -> None:
        """Handle SET_GPS_GLOBAL_ORIGIN (48): refuse it and report the present origin."""
        self._status_text.complain("Origin refused: it is set already", now)
        self._telemetry.request(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)

    def _set_home(self, order: Order) -> CommandRefusal | None:
        """Set home to the present position if parameter 1 is 1, else to parameters 5 to 7.

        These are in degrees and metres above mean sea level, unless the frame of a COMMAND_INT makes the
        altitude relative to home.
        """
        if order.params[0] == 1.0:
            if not self._ready():
                return CommandRefusal(
                    mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "Home refused: no position yet"
                )
            return self._move(*self._origin.geodetic(self._estimate().position))
        if order.integer and order.relative is None:
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Home refused: this frame is not known")
        latitude, longitude, altitude = order.place
        if order.relative:
            altitude += self._home.altitude
        return self._move(latitude, longitude, altitude)

    def _move(self, latitude: float, longitude: float, altitude: float) -> CommandRefusal | None:
        if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and abs(altitude) <= _MAX_DISTANCE):
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Home refused: no such place on the globe")
        if math.dist(self._origin.local(latitude, longitude, altitude), (0.0, 0.0, 0.0)) > _MAX_DISTANCE:
            return CommandRefusal(mavlink.MAV_RESULT_DENIED, "Home refused: more than 100 km from here")
        self._home.move(latitude, longitude, altitude)
        self._telemetry.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
        return None
