"""What the vehicles' cameras saw, at the samples of the animated flight."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mavlink_bridge.frames import FleetFrame
from outrider.report import clocks
from outrider.report.run import Array, Log, Run
from outrider.scene.camera_view import COLUMNS, CameraReceiver

_FRESH_S = 1.0
"""Age (s) up to which an image is shown."""


def views(run: Run, systems: tuple[int, ...], times: Array, ahead: Mapping[int, float]) -> Array | None:
    """Return the rows (n, K, 12), see ``camera_view``, at ``times`` (n,), s after the goal event.

    A row is shown from the arrival of its messages on. ``ahead``: for each log's owner see
    ``clocks.offset``. Returns None without any camera, or if the origin of the scenario is not known.
    """
    if run.scenario is None or not any(log.seen for log in run.logs):
        return None
    origin = run.scenario.origin
    frame = FleetFrame(origin.latitude, origin.longitude, origin.altitude)
    found = np.full((len(times), len(systems), COLUMNS), np.nan)
    for log in run.logs:
        if log.owner in systems and log.owner in ahead:
            found[:, systems.index(log.owner)] = _of(log, frame, times, ahead[log.owner])
    return found


def _of(log: Log, frame: FleetFrame, times: Array, ahead: float) -> Array:
    camera, rows, moments = CameraReceiver(), [], []
    for time, said in log.seen:
        if camera.receive(said, frame):
            rows.append(camera.row)
            moments.append(time)
    if not rows:
        return np.full((len(times), COLUMNS), np.nan)
    seconds = np.maximum.accumulate(clocks.seconds(log, moments, ahead))
    last = np.searchsorted(seconds, times, side="right") - 1
    fresh = (last >= 0) & (times - seconds[last] <= _FRESH_S)
    result: Array = np.where(fresh[:, None], np.array(rows, dtype=np.float64)[last], np.nan)
    return result
