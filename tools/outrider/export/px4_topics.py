"""Conversion of an autopilot's MAVLink messages to PX4's topics, where the meaning is the same.

Names, units and frames (NED, body FRD) are those of PX4's messages. A field that MAVLink does not provide is
omitted from the format instead of being invented; a value that MAVLink marks as unknown is NaN. The only
exceptions are the ``valid`` flags of local and global position, which are always true.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from struct import Struct
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from outrider.export.ulog_file import Topic
from outrider.logs.dialect import Kind
from sitl.values.attitudes import quaternion

_ARMED, _DISARMED = 2, 1
"""Values of PX4's arming_state."""
_NAN = math.nan
_CODES: Final = {"bool": "?", "uint8_t": "B", "float": "f", "double": "d"}

Values = Mapping[str, Any]
Numbers = tuple[float, ...]
Origin = tuple[float, float, float]


def _topic(name: str, fields: str) -> Topic:
    pairs = [field.strip().split(" ") for field in fields.split(",")]
    return Topic(name, tuple((kind, field) for kind, field in pairs))


ATTITUDE = _topic("vehicle_attitude", "float[4] q")
RATES = _topic("vehicle_angular_velocity", "float[3] xyz")
LOCAL = _topic(
    "vehicle_local_position",
    "bool xy_valid, bool z_valid, bool v_xy_valid, bool v_z_valid, float x, float y, float z, "
    "float vx, float vy, float vz, "
    "bool xy_global, bool z_global, double ref_lat, double ref_lon, float ref_alt",
)
GLOBAL = _topic(
    "vehicle_global_position", "double lat, double lon, float alt, bool lat_lon_valid, bool alt_valid"
)
FOLLOWED = _topic(
    "vehicle_local_position_setpoint",
    "float x, float y, float z, float yaw, float yawspeed, float vx, float vy, float vz, "
    "float[3] acceleration",
)
ORDERED = _topic(
    "trajectory_setpoint",
    "float[3] position, float[3] velocity, float[3] acceleration, float yaw, float yawspeed",
)
STATUS = _topic(
    "vehicle_status", "uint8_t arming_state, uint8_t system_type, uint8_t system_id, uint8_t component_id"
)
LANDED = _topic("vehicle_land_detected", "bool landed")
BATTERY = _topic("battery_status", "float voltage_v, float current_a, float remaining")


class View(NamedTuple):
    """MAVLink message converted to a PX4 topic."""

    topic: Topic
    values: bytes


class Px4Topics:
    """Converter of the messages of one autopilot, and of the set-points sent to it.

    It stores the last GPS_GLOBAL_ORIGIN, because PX4 includes the origin in every local position.
    """

    def __init__(self, system: int, component: int) -> None:
        self._who = system, component
        self._origin: Origin | None = None

    def said(self, kind: Kind, payload: bytes) -> list[View]:
        """Convert a message of the autopilot itself."""
        if kind.name == "GPS_GLOBAL_ORIGIN":
            values = kind.read(payload)
            self._origin = values["latitude"] / 1e7, values["longitude"] / 1e7, values["altitude"] / 1e3
            return []
        make = _SAID.get(kind.name)
        return [] if make is None else make(self, kind.read(payload))

    def reported(self, kind: Kind, payload: bytes) -> list[View]:
        """Convert a message of another sender.

        Only a set-point in local NED that is sent to this autopilot gives a topic.
        """
        if kind.name != "SET_POSITION_TARGET_LOCAL_NED":
            return []
        values = kind.read(payload)
        system, component = self._who
        if values["target_system"] != system or values["target_component"] not in (0, component):
            return []
        if values["coordinate_frame"] != mavlink.MAV_FRAME_LOCAL_NED:
            return []
        position, velocity, acceleration, yaw, yaw_rate = _setpoint(values)
        return [_view(ORDERED, *position, *velocity, *acceleration, yaw, yaw_rate)]

    def attitude(self, values: Values) -> list[View]:
        """Convert ATTITUDE."""
        angles = values["roll"], values["pitch"], values["yaw"]
        rates = values["rollspeed"], values["pitchspeed"], values["yawspeed"]
        known = all(map(math.isfinite, angles))
        turned = quaternion(*angles) if known else (_NAN, _NAN, _NAN, _NAN)
        return [_view(ATTITUDE, *turned), _view(RATES, *rates)]

    def local(self, values: Values) -> list[View]:
        """Convert LOCAL_POSITION_NED."""
        place = tuple(values[name] for name in ("x", "y", "z", "vx", "vy", "vz"))
        known = self._origin is not None
        origin = self._origin or (_NAN, _NAN, _NAN)
        return [_view(LOCAL, True, True, True, True, *place, known, known, *origin)]

    def globally(self, values: Values) -> list[View]:
        """Convert GLOBAL_POSITION_INT."""
        place = values["lat"] / 1e7, values["lon"] / 1e7, values["alt"] / 1e3
        return [_view(GLOBAL, *place, True, True)]

    def followed(self, values: Values) -> list[View]:
        """Convert POSITION_TARGET_LOCAL_NED, if it is in local NED."""
        if values["coordinate_frame"] != mavlink.MAV_FRAME_LOCAL_NED:
            return []
        position, velocity, acceleration, yaw, yaw_rate = _setpoint(values)
        return [_view(FOLLOWED, *position, yaw, yaw_rate, *velocity, *acceleration)]

    def status(self, values: Values) -> list[View]:
        """Convert HEARTBEAT."""
        armed = _ARMED if values["base_mode"] & mavlink.MAV_MODE_FLAG_SAFETY_ARMED else _DISARMED
        return [_view(STATUS, armed, values["type"], *self._who)]

    def landed(self, values: Values) -> list[View]:
        """Convert EXTENDED_SYS_STATE; an undefined landed state gives nothing."""
        state = values["landed_state"]
        return [_view(LANDED, state == mavlink.MAV_LANDED_STATE_ON_GROUND)] if state else []

    def battery(self, values: Values) -> list[View]:
        """Convert SYS_STATUS."""
        volts, current, left = (
            values["voltage_battery"],
            values["current_battery"],
            values["battery_remaining"],
        )
        return [
            _view(
                BATTERY,
                _NAN if volts == 0xFFFF else volts / 1e3,
                _NAN if current < 0 else current / 1e2,
                _NAN if left < 0 else left / 1e2,
            )
        ]


_SAID: Final[dict[str, Callable[[Px4Topics, Values], list[View]]]] = {
    "ATTITUDE": Px4Topics.attitude,
    "LOCAL_POSITION_NED": Px4Topics.local,
    "GLOBAL_POSITION_INT": Px4Topics.globally,
    "POSITION_TARGET_LOCAL_NED": Px4Topics.followed,
    "HEARTBEAT": Px4Topics.status,
    "EXTENDED_SYS_STATE": Px4Topics.landed,
    "SYS_STATUS": Px4Topics.battery,
}
TOPICS: Final = (ATTITUDE, RATES, LOCAL, GLOBAL, FOLLOWED, ORDERED, STATUS, LANDED, BATTERY)


def _struct(topic: Topic) -> Struct:
    codes = []
    for kind, _ in topic.fields:
        base, _, count = kind.partition("[")
        codes.append(count.rstrip("]") + _CODES[base])
    return Struct("<" + "".join(codes))


_STRUCTS: Final = {topic: _struct(topic) for topic in TOPICS}


def _view(topic: Topic, *values: float) -> View:
    return View(topic, _STRUCTS[topic].pack(*values))


def _setpoint(values: Values) -> tuple[Numbers, Numbers, Numbers, float, float]:
    """Return position, velocity, acceleration, yaw and yaw rate of a set-point.

    Values that its type_mask marks as ignored are NaN. If the mask marks the acceleration as a force, it is
    NaN too.
    """
    mask = values["type_mask"]

    def counts(names: tuple[str, str, str], first: int) -> Numbers:
        return tuple(_NAN if mask & first << k else values[name] for k, name in enumerate(names))

    acceleration: Numbers = (_NAN,) * 3
    if not mask & mavlink.POSITION_TARGET_TYPEMASK_FORCE_SET:
        acceleration = counts(("afx", "afy", "afz"), mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE)
    return (
        counts(("x", "y", "z"), mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE),
        counts(("vx", "vy", "vz"), mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE),
        acceleration,
        _NAN if mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE else values["yaw"],
        _NAN if mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE else values["yaw_rate"],
    )
