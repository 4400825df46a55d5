"""Pace of a vehicle's clock in a companion's log: whether its simulation was as fast as the wall clock.

A simulation that stands still for half a second has set-points that are a metre away at its end, whatever the
companion does. Messages are delayed by links and by readers, but some hardly are: the least delay of a second
shows how far the vehicle's clock is behind.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import LocalPosition
from mavlink_bridge.tlog.log import TlogReader
from mavlink_bridge.wire.codec import Codec

Array = NDArray[np.float64]
_WINDOW_S: Final = 1.0
_ENOUGH: Final = 10
"""Number of messages in a window of which one is assumed to be prompt."""
_LEAST_S: Final = 10.0
"""Length (s) below which a log says nothing of the pace."""


class Pace(NamedTuple):
    """``factor``: time of the vehicle's clock per time of the companion's.

    ``lost`` (s): the most by which the vehicle's clock fell behind within about a second.
    """

    factor: float
    lost: float

    @property
    def document(self) -> dict[str, float]:
        """Values for JSON."""
        return {"factor": round(self.factor, 4), "lost_s": round(self.lost, 3)}


def pace_of(logs: Sequence[Path], system: int) -> Pace | None:
    """Return the slowest pace of ``system`` in ``logs``; None if they are all shorter than ten seconds."""
    found = [pace for pace in (_pace(*_stamps(log, system)) for log in logs) if pace is not None]
    if not found:
        return None
    return Pace(min(pace.factor for pace in found), max(pace.lost for pace in found))


def _stamps(log: Path, system: int) -> tuple[Array, Array]:
    """Return the times (n,) s of the reported positions, and the vehicle's stamps (n,) s."""
    codec = Codec(
        lambda identifier, sender, _component: (
            identifier == mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED and sender == system
        )
    )
    rows = [
        (1e-6 * record.time, 1e-6 * message.time_boot)
        for record in TlogReader(log)
        for message in codec.feed(record.frame, whole=True)
        if isinstance(message, LocalPosition)
    ]
    times, stamps = np.array(rows, dtype=np.float64).reshape(-1, 2).T
    return times, stamps


def _pace(times: Array, stamps: Array) -> Pace | None:
    """Return the pace of a vehicle whose ``stamps`` (n,) arrived at ``times`` (n,), s."""
    if len(times) < 2 or times[-1] - times[0] < _LEAST_S:
        return None
    delays = times - stamps
    edges = np.arange(times[0], times[-1], _WINDOW_S)
    begins = np.searchsorted(times, edges)
    parts = np.split(delays, begins[1:])
    least = np.array([part.min() for part in parts if len(part) >= _ENOUGH])
    if not len(least):
        return None
    behind = float(least[-1] - least[0])
    return Pace(1.0 - behind / float(times[-1] - times[0]), max(float(np.diff(least).max()), 0.0))
