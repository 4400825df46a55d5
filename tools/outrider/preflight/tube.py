"""Tracking error of a vehicle in a recorded flight: how far it was from its set-points, at most.

A log has the set-points that a companion sent and the positions that the autopilot reported. Both are in the
vehicle's own local frame and on one clock, that of the log. A position is compared with the set-point sent
before it, moved on by its velocity and acceleration, while the autopilot is in the mode in which it follows
set-points: some are sent before. The position was true some milliseconds before it was
recorded, so the error is overestimated by the speed times this delay.
"""

from __future__ import annotations

from math import hypot
from pathlib import Path
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.autopilots import is_guided
from companion.flight.autopilots.known import profile_of
from mavlink_bridge.errors import LogError
from mavlink_bridge.messages import Heartbeat, LocalPosition, SetpointLocal, Vector
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from outrider.errors import InputError

_FRESH_US: Final = 200_000
"""Age (µs) of the last set-point up to which the vehicle is assumed to follow it."""
_LEAST_S: Final = 10.0
"""Duration (s) of flight below which a log says nothing."""
_NO_AUTOPILOT: Final[int] = mavlink.MAV_AUTOPILOT_INVALID
_POSITION_IGNORED: Final = 0x007
"""Bits of the type mask that ignore the position."""
_IDS: Final = (
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
)


class TrackingError(NamedTuple):
    """``largest`` distance (m) from the set-points in ``seconds`` of flight.

    ``acceleration`` (m/s²): largest horizontal one of the set-points.
    """

    largest: float
    seconds: float
    acceleration: float


def tracking_error(path: Path, system: int, *, planar: bool) -> TrackingError:
    """Return the tracking error of the vehicle ``system`` in a log; without heights if ``planar``.

    Raises InputError for a log that cannot be read, and for one with less than 10 s of set-points and
    positions of this vehicle.
    """
    codec = Codec(lambda identifier, sender, _component: identifier in _IDS and sender == system)
    last: tuple[int, SetpointLocal] | None = None
    largest = acceleration = 0.0
    followed, before, guided = 0, None, False
    try:
        for record in read_tlog(path):
            for message in codec.feed(record.frame, whole=True):
                if isinstance(message, Heartbeat):
                    guided = _guided(message) if message.autopilot != _NO_AUTOPILOT else guided
                elif isinstance(message, SetpointLocal):
                    if not message.type_mask & _POSITION_IGNORED:
                        last = record.time, message
                        acceleration = max(acceleration, _finite(hypot(*message.acceleration[:2])))
                elif isinstance(message, LocalPosition) and last is not None:
                    age = record.time - last[0]
                    if guided and 0 <= age <= _FRESH_US:
                        largest = max(largest, _distance(last[1], age, message, planar=planar))
                        followed += 0 if before is None else min(max(record.time - before, 0), _FRESH_US)
                        before = record.time
                    else:
                        before = None
    except LogError as error:
        raise InputError(f"--flight {error}") from None
    seconds = 1e-6 * followed
    if seconds < _LEAST_S:
        raise InputError(
            f"--flight {path}: has {seconds:.0f} s of set-points and positions of vehicle {system}; needed:"
            f" {_LEAST_S:.0f} s, in the log of a flight of outrider fly with this vehicle"
        )
    return TrackingError(largest, seconds, acceleration)


def _guided(beat: Heartbeat) -> bool:
    """Return whether the autopilot is armed and follows set-points."""
    profile = profile_of(beat)
    armed = bool(beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    return profile is not None and armed and is_guided(profile, beat)


def _finite(value: float) -> float:
    """Return ``value``, or 0 for a field that is not used."""
    return value if value < 1e6 else 0.0


def _distance(setpoint: SetpointLocal, age: int, position: LocalPosition, *, planar: bool) -> float:
    """Return the distance (m) of a position from a set-point that is ``age`` (µs) old."""
    dt = 1e-6 * age
    where = _moved(setpoint.position, setpoint.velocity, setpoint.acceleration, dt)
    differences = [a - b for a, b in zip(where, position.position_ned, strict=True)]
    return hypot(*differences[: 2 if planar else 3])


def _moved(place: Vector, velocity: Vector, acceleration: Vector, dt: float) -> list[float]:
    return [
        p + _used(v) * dt + 0.5 * _used(a) * dt * dt
        for p, v, a in zip(place, velocity, acceleration, strict=True)
    ]


def _used(value: float) -> float:
    """Return ``value``, or 0 for one that is not finite: the field is ignored by the autopilot."""
    return value if abs(value) < 1e6 else 0.0
