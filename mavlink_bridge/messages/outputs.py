"""Messages of what an autopilot aims at and puts out: targets, odometry, motor outputs, its flight."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import UNKNOWN_U16, Fields, degrees_e7, int16, on_globe
from mavlink_bridge.messages.source import Source, Vector

_NAN = float("nan")
_UNKNOWN_COVARIANCE = (_NAN, *(0.0,) * 20)
_CHANNELS = 16
_ACTUATORS = 32
_RC_CHANNELS = 18


@message("ATTITUDE_TARGET")
class AttitudeTarget(NamedTuple):
    """ATTITUDE_TARGET (83): attitude (w, x, y, z), body rates (rad/s), thrust 0…1; ``mask``: ignored ones."""

    source: Source
    time_boot: int
    attitude: tuple[float, float, float, float]
    body_rates: Vector
    thrust: float
    mask: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> AttitudeTarget:
        return AttitudeTarget(source, fields[0] * 1000, fields[1:5], fields[5:8], *fields[8:])

    def encode(self) -> Fields:
        return self.time_boot // 1000, *self.attitude, *self.body_rates, self.thrust, self.mask


@message("POSITION_TARGET_GLOBAL_INT")
class PositionTargetGlobal(NamedTuple):
    """POSITION_TARGET_GLOBAL_INT (87): place (degrees, m), motion (m/s, m/s², NED), yaw (rad)."""

    source: Source
    time_boot: int
    latitude: float
    longitude: float
    altitude: float
    velocity: Vector
    acceleration: Vector
    yaw: float
    yaw_rate: float
    mask: int
    frame: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> PositionTargetGlobal | None:
        if not on_globe(*fields[1:3]):
            return None
        place = fields[1] / 1e7, fields[2] / 1e7, fields[3]
        return PositionTargetGlobal(
            source, fields[0] * 1000, *place, fields[4:7], fields[7:10], *fields[10:14]
        )

    def encode(self) -> Fields:
        place = (*degrees_e7(self.latitude, self.longitude), self.altitude)
        return self.time_boot // 1000, *place, *self.velocity, *self.acceleration, *self[7:]


@message("ODOMETRY", size_v1=230)
class Odometry(NamedTuple):
    """ODOMETRY (331): pose and velocity in local NED, body rates (rad/s); covariances are unknown.

    ``time`` µs since boot; ``attitude`` (w, x, y, z).
    """

    source: Source
    time: int
    position: Vector
    attitude: tuple[float, float, float, float]
    velocity: Vector
    body_rates: Vector
    frame: int
    child_frame: int
    resets: int
    estimator: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> Odometry:
        motion = fields[1:4], fields[4:8], fields[8:11], fields[11:14]
        return Odometry(source, fields[0], *motion, *fields[56:60])

    def encode(self) -> Fields:
        motion = *self.position, *self.attitude, *self.velocity, *self.body_rates
        return self.time, *motion, *_UNKNOWN_COVARIANCE, *_UNKNOWN_COVARIANCE, *self[6:], 0


@message("SERVO_OUTPUT_RAW", size_v1=21)
class ServoOutput(NamedTuple):
    """SERVO_OUTPUT_RAW (36): up to 16 pulse widths (µs); ``time`` µs since boot, modulo 2³²."""

    source: Source
    time: int
    port: int
    outputs: tuple[int, ...]

    @staticmethod
    def decode(source: Source, fields: Fields) -> ServoOutput:
        return ServoOutput(source, fields[0], fields[9], fields[1:9] + fields[10:])

    def encode(self) -> Fields:
        outputs = self.outputs[:_CHANNELS] + (0,) * (_CHANNELS - len(self.outputs))
        return self.time & 0xFFFFFFFF, *outputs[:8], self.port, *outputs[8:]


@message("ACTUATOR_OUTPUT_STATUS")
class ActuatorOutputs(NamedTuple):
    """ACTUATOR_OUTPUT_STATUS (375): up to 32 outputs, all active; ``time`` µs since boot."""

    source: Source
    time: int
    outputs: tuple[float, ...]

    @staticmethod
    def decode(source: Source, fields: Fields) -> ActuatorOutputs:
        return ActuatorOutputs(source, fields[0], fields[2 : 2 + fields[1].bit_length()])

    def encode(self) -> Fields:
        count = min(len(self.outputs), _ACTUATORS)
        return self.time, (1 << count) - 1, *self.outputs[:count], *(0.0,) * (_ACTUATORS - count)


@message("RC_CHANNELS")
class RcChannels(NamedTuple):
    """RC_CHANNELS (65): up to 18 pulse widths (µs); ``rssi`` 255 if unknown."""

    source: Source
    time_boot: int
    channels: tuple[int, ...]
    rssi: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> RcChannels:
        return RcChannels(source, fields[0] * 1000, fields[1 : 1 + min(fields[19], _RC_CHANNELS)], fields[20])

    def encode(self) -> Fields:
        count = len(self.channels)
        unused = (UNKNOWN_U16,) * (_RC_CHANNELS - count)
        return self.time_boot // 1000, *self.channels, *unused, count, self.rssi


@message("SCALED_PRESSURE", size_v1=14)
class ScaledPressure(NamedTuple):
    """SCALED_PRESSURE (29): static pressure (hPa), temperature (°C); there is no differential pressure."""

    source: Source
    time_boot: int
    pressure: float
    temperature: float

    @staticmethod
    def decode(source: Source, fields: Fields) -> ScaledPressure:
        return ScaledPressure(source, fields[0] * 1000, fields[1], fields[3] / 100)

    def encode(self) -> Fields:
        return self.time_boot // 1000, self.pressure, 0.0, int16(self.temperature * 100), 0


@message("FLIGHT_INFORMATION", size_v1=28)
class FlightInformation(NamedTuple):
    """FLIGHT_INFORMATION (264): times of arming, take-off and landing, and the number of the flight.

    Times are in µs since boot, 0 for none; MAVLink names the first two UTC by mistake. ``landed`` is 0 in
    flight and before.
    """

    source: Source
    armed: int
    took_off: int
    flight: int
    time_boot: int
    landed: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> FlightInformation:
        armed, took_off, flight, time, landed = fields
        return FlightInformation(source, armed, took_off, flight, time * 1000, landed * 1000)

    def encode(self) -> Fields:
        return *self[1:4], self.time_boot // 1000, self.landed // 1000


@message("UTM_GLOBAL_POSITION")
class UtmGlobalPosition(NamedTuple):
    """UTM_GLOBAL_POSITION (340): ``time`` Unix (µs); place and velocity as GLOBAL_POSITION_INT.

    ``uid`` has 18 bytes; ``state`` is UTM_FLIGHT_STATE, ``flags`` are UTM_DATA_AVAIL_FLAGS. Accuracies (m,
    m, m/s). The next waypoint is not given.
    """

    source: Source
    time: int
    latitude: float
    longitude: float
    altitude: float
    relative_altitude: float
    velocity_ned: Vector
    accuracies: Vector
    uid: bytes
    state: int
    flags: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> UtmGlobalPosition | None:
        if not on_globe(*fields[1:3]):
            return None
        vx, vy, vz = (value / 1e2 for value in fields[8:11])
        horizontal, vertical, speed = (value / 1e3 for value in fields[11:14])
        place = fields[1] / 1e7, fields[2] / 1e7, fields[3] / 1e3, fields[4] / 1e3
        accuracies = horizontal, vertical, speed
        return UtmGlobalPosition(source, fields[0], *place, (vx, vy, vz), accuracies, *fields[15:])

    def encode(self) -> Fields:
        place = (*degrees_e7(self.latitude, self.longitude), *(round(1e3 * z) for z in self[4:6]))
        velocity = (int16(100 * value) for value in self.velocity_ned)
        accuracies = (min(round(1e3 * value), UNKNOWN_U16) for value in self.accuracies)
        return self.time, *place, 0, 0, 0, *velocity, *accuracies, 0, *self[8:]
