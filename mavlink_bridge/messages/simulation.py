"""Messages of the ground truth that simulations of real firmware send."""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import Fields, degrees_e7, on_globe
from mavlink_bridge.messages.source import Source, Vector


@message("SIMSTATE", finite=True)
class SimState(NamedTuple):
    """SIMSTATE (164, ardupilotmega): ground truth of a simulation.

    Euler angles (rad), specific force (m/s², FRD), body rates (rad/s), latitude and longitude (degrees).
    """

    source: Source
    roll: float
    pitch: float
    yaw: float
    specific_force: Vector
    body_rates: Vector
    latitude: float
    longitude: float

    @staticmethod
    def decode(source: Source, fields: Fields) -> SimState | None:
        if not on_globe(fields[9], fields[10]):
            return None
        roll, pitch, yaw = fields[:3]
        return SimState(source, roll, pitch, yaw, fields[3:6], fields[6:9], fields[9] / 1e7, fields[10] / 1e7)

    def encode(self) -> Fields:
        place = degrees_e7(self.latitude, self.longitude)
        return self.roll, self.pitch, self.yaw, *self.specific_force, *self.body_rates, *place


@message("SIM_STATE", finite=True, size_v1=84)
class SimulationState(NamedTuple):
    """SIM_STATE (108): ground truth without a time stamp; ArduPilot's simulation sends it on request.

    Latitude and longitude (degrees), altitude above mean sea level (m, float32), velocity (m/s).
    """

    source: Source
    latitude: float
    longitude: float
    altitude: float
    velocity_ned: Vector

    @staticmethod
    def decode(source: Source, fields: Fields) -> SimulationState | None:
        latitude, longitude = fields[21:]
        # The float32 degrees resolve only about a metre; they are used if the extension fields are missing.
        if not (latitude or longitude):
            if not (isfinite(fields[13]) and isfinite(fields[14])):
                return None
            latitude, longitude = round(fields[13] * 1e7), round(fields[14] * 1e7)
        if not on_globe(latitude, longitude):
            return None
        return SimulationState(source, latitude / 1e7, longitude / 1e7, fields[15], fields[18:21])

    def encode(self) -> Fields:
        place = degrees_e7(self.latitude, self.longitude)
        attitude = (1.0, *[0.0] * 12)
        return *attitude, self.latitude, self.longitude, self.altitude, 0.0, 0.0, *self.velocity_ned, *place


@message("HIL_STATE_QUATERNION", finite=True)
class HilState(NamedTuple):
    """HIL_STATE_QUATERNION (115): ground truth of PX4's simulation in hardware (SIH).

    ``time`` µs since boot; altitude m above mean sea level; velocity m/s in steps of 1 cm/s.
    """

    source: Source
    time: int
    latitude: float
    longitude: float
    altitude: float
    velocity_ned: Vector

    @staticmethod
    def decode(source: Source, fields: Fields) -> HilState | None:
        latitude, longitude, altitude, vx, vy, vz = fields[8:14]
        if not on_globe(latitude, longitude):
            return None
        velocity = (vx / 1e2, vy / 1e2, vz / 1e2)
        return HilState(source, fields[0], latitude / 1e7, longitude / 1e7, altitude / 1e3, velocity)

    def encode(self) -> Fields:
        place = degrees_e7(self.latitude, self.longitude)
        velocity = (round(v * 1e2) for v in self.velocity_ned)
        attitude = (1.0, *[0.0] * 6)
        return self.time, *attitude, *place, round(self.altitude * 1e3), *velocity, *[0] * 5
