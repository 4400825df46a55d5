"""Contents of a companion's log: its set-points, and the positions that its autopilot reported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

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


class Flown(NamedTuple):
    """Flight on the trial's time.

    ``setpoints`` are those that the companion sent; ``reported`` is the track of the vehicle's own estimate.
    """

    setpoints: Setpoints
    reported: Track


def flown(path: Path, system: int, fleet: FleetFrame, seconds: Callable[[Array], Array]) -> Flown | None:
    """Return the flight in the log at ``path`` of the companion of ``system``; None without set-points.

    The target's time stamps relate the companion's clock to the trial's: ``seconds`` converts times since the
    target's boot (µs) to times of the trial (s).
    """
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
                told.append((at, *message.position_ned))
            elif isinstance(message, GpsGlobalOrigin) and own:
                local = fleet.local(message.latitude, message.longitude, message.altitude)
            elif isinstance(message, GlobalPosition) and message.source.system == TARGET:
                ties.append((at, message.time_boot))
    if local is None or len(ties) < 2:
        return None
    tied = np.array(ties, dtype=np.float64)
    tied[:, 1] = seconds(tied[:, 1])
    rows, places = _between(sent, tied), _between(told, tied)
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
    return Flown(setpoints, Track(times, local.position_to_fleet(places[:, 1:]), known))


def _between(rows: list[tuple[float, ...]], tied: Array) -> Array:
    """Return the rows whose time, in the first column, is between the first and the last of ``tied``."""
    return np.array([row for row in rows if tied[0, 0] <= row[0] <= tied[-1, 0]])
