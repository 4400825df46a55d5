"""Data that the page's script draws, as one JSON document.

An array is stored as text: the base64 of little-endian integers, multiples of a quantum.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from outrider.report.charts import Chart, Histogram
from outrider.report.events import Event
from outrider.report.run import Array, Motions, Run
from outrider.report.scene import scene
from outrider.simulation.conductor import HOLD

MILLIMETRE, TENTH = 1e-3, 1e-4
"""Quanta: of lengths and speeds, 1 mm and 1 mm/s; of angles and times, 0.1 mrad and 0.1 ms."""
_CENTIMETRE, _MILLIRADIAN = 1e-2, 1e-3
_AFTER = 5.0
"""Time (s) for which a run is shown after the end of ``HOLD``, which begins with convergence."""


class Packed(NamedTuple):
    """Encoded array.

    ``shape``; ``kind`` of the integers, i2 or i4, little-endian; ``quantum``: value of one unit; ``data``:
    base64. The smallest integer of the kind represents NaN.
    """

    shape: tuple[int, ...]
    kind: str
    quantum: float
    data: str


def document(
    run: Run,
    motions: Motions,
    shown: np.ndarray,
    charts: Sequence[Chart],
    spent: Histogram | None,
    events: Sequence[Event],
    views: Array | None = None,
) -> str:
    """Return the JSON document for the samples ``shown`` (n,); ``views`` (n, K, 12) are the cameras' rows.

    It may stand in a script element: it contains no ``<``.
    """
    begin, end = clock(run, motions)
    found = {
        "systems": motions.system,
        "from": round(begin, 4),
        "to": round(end, 4),
        "time": packed(motions.time[shown], TENTH),
        "position": packed(motions.position[shown], MILLIMETRE),
        "velocity": packed(motions.velocity[shown], MILLIMETRE),
        "reference": packed(motions.reference[shown], MILLIMETRE),
        "yaw": packed(motions.yaw[shown], TENTH),
        "tilt": packed(motions.tilt[shown], TENTH),
        "target": packed(motions.target[shown], MILLIMETRE),
        "moving": packed(motions.moving[shown], MILLIMETRE),
        "cameras": None if views is None else _cameras(views),
        "scene": scene(run, motions),
        "charts": [_chart(chart) for chart in charts],
        "spent": None if spent is None else spent._asdict(),
        "events": [event._asdict() for event in events if event.until is not None or event.kind in _MARKED],
    }
    text = json.dumps(found, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


_MARKED = ("goal", "converged", "fault", "target", "bystander", "too near")


def clock(run: Run, motions: Motions) -> tuple[float, float]:
    """Return the start and the end (s) of the relevant part of the flight, which the page shows first."""
    first, last = float(motions.time[0]), float(motions.time[-1])
    seconds = run.summary.get("convergence_time_s")
    end = last
    if isinstance(seconds, int | float):
        end = seconds + HOLD * 1e-6 + _AFTER
    elif run.scenario is not None:
        end = run.scenario.duration_s
    return (max(first, -1.0), min(last, end)) if last > 0.0 else (first, last)


def packed(values: Array, quantum: float) -> dict[str, Any]:
    """Return encoded values as the page reads them."""
    return pack(values, quantum)._asdict()


def pack(values: Array, quantum: float) -> Packed:
    """Round ``values`` to multiples of ``quantum`` and encode them.

    Values that are not finite, or do not fit into 32 bits, become NaN.
    """
    with np.errstate(invalid="ignore"):
        whole = np.round(np.asarray(values, dtype=np.float64) / quantum)
        whole = np.where(np.abs(whole) < np.iinfo(np.int32).max, whole, np.nan)
    most = float(np.abs(np.nan_to_num(whole)).max(initial=0.0))
    kind = np.dtype("<i2" if most <= np.iinfo(np.int16).max else "<i4")
    nothing = np.iinfo(kind).min
    integers = np.where(np.isnan(whole), nothing, np.nan_to_num(whole)).astype(kind)
    data = base64.b64encode(integers.tobytes()).decode("ascii")
    return Packed(integers.shape, kind.str[1:], quantum, data)


def unpack(packed: Packed) -> Array:
    """Decode an array, as the page's own script does."""
    integers = np.frombuffer(base64.b64decode(packed.data), dtype=f"<{packed.kind}").reshape(packed.shape)
    values = integers * packed.quantum
    result: Array = np.where(integers == np.iinfo(integers.dtype).min, np.nan, values)
    return result


def _cameras(views: Array) -> dict[str, Any]:
    """Return direction of the optical axes and detections, and the angles of view (rad, one pair each).

    An axis is three angles (rad): from east towards north, above the horizon, and the roll about it.
    """
    w, x, y, z = np.moveaxis(views[..., 3:7], -1, 0)
    heading = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    with np.errstate(invalid="ignore"):
        pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    each = []
    for k in range(views.shape[1]):
        known = [pair for pair in views[:, k, 7:9].tolist() if np.isfinite(pair).all()]
        each.append(known[-1] if known else None)
    return {
        "axis": packed(np.stack([0.5 * np.pi - heading, pitch, roll], axis=-1), _MILLIRADIAN),
        "seen": packed(views[..., 9:], _CENTIMETRE),
        "fields": each,
    }


def _chart(chart: Chart) -> dict[str, Any]:
    values = np.stack([line.values for line in chart.lines], axis=1)
    most = float(np.abs(values[np.isfinite(values)]).max(initial=1e-6))
    # A chart is a few hundred pixels high; steps this small are invisible, and the values fit 16 bits.
    quantum = most / 32_000.0 if chart.quantum is None else chart.quantum
    return {
        **chart._replace(lines=(), levels=())._asdict(),
        "time": None if chart.time is None else packed(chart.time, TENTH),
        "lines": [{"name": line.name, "system": line.system} for line in chart.lines],
        "levels": [level._asdict() for level in sorted(chart.levels, key=lambda level: -level.value)],
        "values": packed(values, quantum),
    }
