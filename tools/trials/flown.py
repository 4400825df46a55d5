"""Contents of a companion's log: its set-points, and the positions that its autopilot reported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.frames import FleetFrame, LocalFrame
from mavlink_bridge.messages import GlobalPosition, GpsGlobalOrigin, LocalPosition, SetpointLocal
from mavlink_bridge.tlog.log import TlogReader
from mavlink_bridge.wire.codec import Codec
from trials.measures import Setpoints
from trials.plan import TARGET
from trials.separation import Track

Array = NDArray[np.float64]
_READ = frozenset(
    (
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
    )
)

_NEAR_S: Final = 5.0
"""Time (s) within which the fastest message shows the delay of the link."""
_LATE_S: Final = 0.1
"""Further delay (s) above which a position was read late."""


class Flown(NamedTuple):
    """Flight on the trial's time.

    ``setpoints`` are those that the companion sent; ``reported`` is the track of the vehicle's own estimate.
    """

    setpoints: Setpoints
    reported: Track


class _Rows(NamedTuple):
    """Rows of a log, each with its time by the companion's clock (s) in the first column.

    ``sent``: set-points; ``told``: reported positions, after their time stamps (s); both in the vehicle's
    frame ``local``. ``ties``: time stamps of the target (µs).
    """

    sent: list[tuple[float, ...]]
    told: list[tuple[float, ...]]
    ties: list[tuple[float, float]]
    local: LocalFrame


def flown(path: Path, system: int, fleet: FleetFrame, seconds: Callable[[Array], Array]) -> Flown | None:
    """Return the flight in the log at ``path`` of the companion of ``system``; None without set-points.

    The target's time stamps relate the companion's clock to the trial's: ``seconds`` converts times since the
    target's boot (µs) to times of the trial (s).
    """
    rows = _rows(path, system, fleet)
    if rows is None or len(rows.ties) < 2:
        return None
    tied = np.array(rows.ties, dtype=np.float64)
    tied[:, 1] = seconds(tied[:, 1])
    return _flown(rows, tied)


def flown_by_clock(
    path: Path, system: int, fleet: FleetFrame, seconds: Callable[[Array], Array]
) -> Flown | None:
    """Return the flight in the log at ``path`` of the companion of ``system``; None without set-points.

    ``seconds`` converts times of the companion's clock (s) to times of the trial (s), linearly. Positions
    that a companion which hung has read late are left out.
    """
    rows = _rows(path, system, fleet)
    if rows is None or not rows.told:
        return None
    ends = np.array([rows.told[0][0], rows.told[-1][0]])
    return _flown(rows._replace(told=_prompt(rows.told)), np.column_stack([ends, seconds(ends)]))


def _prompt(told: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Return the rows whose time is within ``_LATE_S`` of their time stamp, as of the fastest near it."""
    times = np.array([row[0] for row in told])
    delays = times - np.array([row[1] for row in told])
    begins = np.searchsorted(times, times - _NEAR_S)
    ends = np.searchsorted(times, times + _NEAR_S, side="right")
    return [
        row
        for row, delay, begin, end in zip(told, delays, begins, ends, strict=True)
        if delay - delays[begin:end].min() <= _LATE_S
    ]


def _rows(path: Path, system: int, fleet: FleetFrame) -> _Rows | None:
    """Return the rows of a log; None if the origin of the vehicle's frame is not in it."""
    codec = Codec(lambda identifier, _system, _component: identifier in _READ)
    sent: list[tuple[float, ...]] = []
    told: list[tuple[float, ...]] = []
    ties: list[tuple[float, float]] = []
    local: LocalFrame | None = None
    for record in TlogReader(path):
        at = record.time * 1e-6
        for message in codec.feed(record.frame, whole=True):
            own = message.source.system == system
            if isinstance(message, SetpointLocal) and own:
                sent.append((at, *message.position, *message.velocity, *message.acceleration))
            elif isinstance(message, LocalPosition) and own:
                told.append((at, 1e-6 * message.time_boot, *message.position_ned))
            elif isinstance(message, GpsGlobalOrigin) and own:
                local = fleet.local(message.latitude, message.longitude, message.altitude)
            elif isinstance(message, GlobalPosition) and message.source.system == TARGET:
                ties.append((at, message.time_boot))
    return None if local is None else _Rows(sent, told, ties, local)


def _flown(found: _Rows, tied: Array) -> Flown | None:
    """Return the flight on the trial's time; ``tied`` (n, 2): times of the companion and of the trial (s)."""
    rows, places, local = _between(found.sent, tied), _between(found.told, tied), found.local
    if not len(rows) or not len(places):
        return None
    setpoints = Setpoints(
        np.interp(rows[:, 0], *tied.T),
        rows[:, 0],
        local.position_to_fleet(rows[:, 1:4]),
        local.velocity_to_fleet(rows[:, 4:7]),
        local.velocity_to_fleet(rows[:, 7:10]),
    )
    times = np.interp(places[:, 0], *tied.T)
    known = np.ones(len(times), dtype=bool)
    return Flown(setpoints, Track(times, local.position_to_fleet(places[:, 2:]), known))


def _between(rows: list[tuple[float, ...]], tied: Array) -> Array:
    """Return the rows whose time, in the first column, is between the first and the last of ``tied``."""
    return np.array([row for row in rows if tied[0, 0] <= row[0] <= tied[-1, 0]])
