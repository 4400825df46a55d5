"""Summary and runs of a sweep as Parquet files, if pyarrow is installed (extra ``export``)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from math import isfinite
from pathlib import Path
from typing import Any

from outrider.runs import whole_file
from outrider.sweep.report import CellReport
from outrider.sweep.runs import Ending, Run

CELLS, RUNS = "summary.parquet", "runs.parquet"


def write(folder: Path, cells: Sequence[CellReport], runs: Mapping[str, Sequence[Run]]) -> None:
    """Write a row for each cell, with its intervals, and a row for each run, in the order of seeds.

    Values that are not known or not finite are null. Without pyarrow no files are written, and older ones are
    removed.
    """
    if find_spec("pyarrow") is None:
        for name in (CELLS, RUNS):
            (folder / name).unlink(missing_ok=True)
        return
    import pyarrow as pa
    import pyarrow.parquet as parquet

    text, whole, real = pa.string(), pa.int64(), pa.float64()
    kinds = {str: text, int: whole, float: real, bool: pa.bool_()}
    for name, rows, fields in (
        (CELLS, [_cell_row(cell) for cell in cells], _CELL_FIELDS),
        (RUNS, [_run_row(cell, run) for cell in cells for run in runs[cell.key]], _RUN_FIELDS),
    ):
        schema = pa.schema([(field, kinds[kind]) for field, kind in fields.items()])
        content = pa.BufferOutputStream()
        parquet.write_table(pa.Table.from_pylist(rows, schema=schema), content)
        whole_file.write(folder / name, content.getvalue().to_pybytes())


_COUNTS = ("runs", "ended", "converged", "stuck", "violations", "failed", "faults", "lost")
_INTERVALS = {
    "converged_rate": "converged_rate",
    "violation_rate": "violation_rate",
    "time_median": "convergence_time_median_s",
    "time_p95": "convergence_time_p95_s",
}
_SPREADS = {
    "separation": ("min_separation", "m", "least", "p5"),
    "to_obstacle": ("min_obstacle_distance", "m", "least", "p5"),
    "yaw": ("yaw_error_p95", "deg", "largest", "p95"),
    "tracking": ("tracking_error_p95", "m", "largest", "p95"),
}
_CELL_FIELDS: dict[str, type] = {
    "cell": str,
    "key": str,
    **dict.fromkeys(_COUNTS, int),
    **{f"{name}{end}": float for name in _INTERVALS.values() for end in ("", "_low", "_high")},
    "convergence_time_worst_s": float,
    **{f"{n}_{w}_{u}": float for n, u, *ws in _SPREADS.values() for w in (*ws, "median")},
    "d_min_m": float,
    "span_m": float,
}
_RUN_FIELDS: dict[str, type] = {
    "cell": str,
    "key": str,
    "seed": int,
    "ending": str,
    "converged": bool,
    "convergence_time_s": float,
    "min_separation_m": float,
    "min_obstacle_distance_m": float,
    "d_min_violations": int,
    "yaw_error_p95_deg": float,
    "tracking_error_p95_m": float,
    "what": str,
}


def _cell_row(cell: CellReport) -> dict[str, Any]:
    row: dict[str, Any] = {"cell": cell.label, "key": cell.key, "d_min_m": cell.d_min, "span_m": cell.span}
    row |= {name: getattr(cell, name) for name in _COUNTS}
    row["convergence_time_worst_s"] = cell.time_worst
    for attribute, name in _INTERVALS.items():
        interval = getattr(cell, attribute)
        if interval is not None:
            ends = {"": interval.value, "_low": interval.low, "_high": interval.high}
            row |= {f"{name}{end}": _finite(value) for end, value in ends.items()}
    for attribute, (name, unit, *words) in _SPREADS.items():
        row |= {
            f"{name}_{word}_{unit}": value
            for word, value in zip((*words, "median"), getattr(cell, attribute), strict=True)
        }
    return row


def _run_row(cell: CellReport, run: Run) -> dict[str, Any]:
    violations = None if run.ending in (Ending.FAULT, Ending.LOST) else run.violations
    seconds = _finite(run.seconds)
    head = (cell.label, cell.key, run.seed, run.ending.value, run.converged, seconds, run.separation)
    rest = (run.to_obstacle, violations, run.yaw, run.tracking, run.what)
    return dict(zip(_RUN_FIELDS, (*head, *rest), strict=True))


def _finite(value: float | None) -> float | None:
    """Return a finite number unchanged, otherwise None."""
    return value if value is not None and isfinite(value) else None
