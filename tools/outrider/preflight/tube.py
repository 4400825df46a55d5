"""Tracking error of a vehicle in a flight: how far it was from its set-points, at most.

There are the set-points that a companion sent and the positions that the autopilot reported. Both are in the
vehicle's own local frame and on one clock, that of the log. A position is compared with the set-point sent
before it, moved on by its velocity and acceleration, while the autopilot is in the mode in which it follows
set-points: some are sent before. The position was true some milliseconds before it was
recorded, so the error is overestimated by the speed times this delay.
"""

from __future__ import annotations

from collections import deque
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
_WINDOW_US: Final = 200_000
"""Time (µs) over which the set-points' velocities are compared for their acceleration."""
LEAST_S: Final = 10.0
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

    ``acceleration`` (m/s²): largest horizontal one of the set-points' motion.
    """

    largest: float
    seconds: float
    acceleration: float


class TrackingMeter:
    """Meter of the tracking error of the vehicle ``system``; without heights if ``planar``.

    ``lead`` (µs): ``setpoint_lead_us`` of the companion. Each set-point is the planned motion so much after
    it was sent.
    """

    def __init__(self, system: int, *, planar: bool, lead: int = 0) -> None:
        self._planar, self._lead = planar, lead
        self._codec = Codec(lambda identifier, sender, _component: identifier in _IDS and sender == system)
        self._sent: deque[tuple[int, SetpointLocal]] = deque()
        self._largest = self._acceleration = 0.0
        self._before: int | None = None
        self._followed, self._guided = 0, False

    def receive(self, time: int, frame: bytes) -> None:
        """Receive a ``frame`` that was sent or received at ``time`` (µs)."""
        for message in self._codec.feed(frame, whole=True):
            if isinstance(message, Heartbeat):
                self._guided = _guided(message) if message.autopilot != _NO_AUTOPILOT else self._guided
            elif isinstance(message, SetpointLocal):
                if not message.type_mask & _POSITION_IGNORED:
                    self._add(time, message)
            elif isinstance(message, LocalPosition) and self._sent:
                self._compare(time, message)

    @property
    def result(self) -> TrackingError:
        """The tracking error so far."""
        return TrackingError(self._largest, 1e-6 * self._followed, self._acceleration)

    def _add(self, time: int, setpoint: SetpointLocal) -> None:
        """Add a set-point; its acceleration counts as far as the velocities have changed accordingly.

        Some of the acceleration may compensate drag and wind, and velocities may jump where a plan begins
        anew.
        """
        while len(self._sent) > 1 and time - self._sent[1][0] >= _WINDOW_US:
            self._sent.popleft()
        if self._sent and time - self._sent[0][0] >= _WINDOW_US:
            since, first = self._sent[0]
            changes = zip(setpoint.velocity[:2], first.velocity[:2], strict=True)
            changed = hypot(*(_used(new) - _used(old) for new, old in changes)) / (1e-6 * (time - since))
            asked = hypot(*(_used(a) for a in setpoint.acceleration[:2]))
            self._acceleration = max(self._acceleration, min(asked, changed))
        self._sent.append((time, setpoint))

    def _compare(self, time: int, position: LocalPosition) -> None:
        """Compare a position with the last set-point, while the autopilot follows set-points."""
        sent, setpoint = self._sent[-1]
        if not (self._guided and 0 <= time - sent <= _FRESH_US):
            self._before = None
            return
        distance = _distance(setpoint, time - sent - self._lead, position, planar=self._planar)
        self._largest = max(self._largest, distance)
        self._followed += 0 if self._before is None else min(max(time - self._before, 0), _FRESH_US)
        self._before = time


def tracking_error(path: Path, system: int, *, planar: bool, lead: int = 0) -> TrackingError:
    """Return the tracking error of the vehicle ``system`` in a log, see ``TrackingMeter``.

    Raises InputError for a log that cannot be read, and for one with less than 10 s of set-points and
    positions of this vehicle.
    """
    meter = TrackingMeter(system, planar=planar, lead=lead)
    try:
        for record in read_tlog(path):
            meter.receive(record.time, record.frame)
    except LogError as error:
        raise InputError(f"--flight {error}") from None
    found = meter.result
    if found.seconds < LEAST_S:
        raise InputError(
            f"--flight {path}: has {found.seconds:.0f} s of set-points and positions of vehicle {system};"
            f" needed: {LEAST_S:.0f} s, in the log of a flight of outrider fly with this vehicle"
        )
    return found


def _guided(beat: Heartbeat) -> bool:
    """Return whether the autopilot is armed and follows set-points."""
    profile = profile_of(beat)
    armed = bool(beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    return profile is not None and armed and is_guided(profile, beat)


def _distance(setpoint: SetpointLocal, age: int, position: LocalPosition, *, planar: bool) -> float:
    """Return the distance (m) of a position from a set-point of ``age`` (µs) ago, which may be negative."""
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
