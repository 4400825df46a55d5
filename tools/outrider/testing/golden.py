"""Golden files: set-points of a flight that was inspected and accepted, as CSV compressed with gzip."""

from __future__ import annotations

import csv
import gzip
from io import StringIO
from pathlib import Path

import numpy as np

from outrider.shadow.setpoints import Course

FLAG = "--update-golden"
_HEAD = (
    *("time_ms", "north_m", "east_m", "down_m", "v_north_m_s", "v_east_m_s", "v_down_m_s"),
    *("a_north_m_s2", "a_east_m_s2", "a_down_m_s2", "yaw_rad", "mask", "frame"),
)
_AXES = ("north", "east", "down")
_NAMES = (
    *_AXES,
    *(f"velocity {axis}" for axis in _AXES),
    *(f"acceleration {axis}" for axis in _AXES),
    *("yaw", "mask", "frame"),
)
_UNITS = (*("m",) * 3, *("m/s",) * 3, *("m/s²",) * 3, "rad", "", "")
_YAW, _ACCELERATIONS = 9, slice(6, 9)
_ACCELERATION_FACTOR = 10.0
"""Factor on the tolerance of accelerations, which are the noisiest values."""
_DIGITS = 4
_TIME_UNIT_US = 1_000
"""Resolution of times (µs): they are stored in milliseconds."""


class Golden:
    """Golden files in ``directory``; ``update``: write them instead of comparing."""

    def __init__(self, directory: Path, *, update: bool) -> None:
        self._directory, self._update = directory, update
        self.written: list[Path] = []

    def check(self, name: str, whose: str, of: Course, within: float) -> None:
        """Compare the set-points ``of`` with the golden file ``name``, or write it.

        Raises AssertionError if they differ (its text says where and by how much), if there are no
        set-points, or if the file is missing or damaged; ValueError for a bad ``name`` or ``within``. See
        ``Setpoints.assert_golden``.
        """
        __tracebackhide__ = True
        if not within > 0.0:
            raise ValueError(f"within = {within:g} must be more than 0")
        if Path(name).name != name:
            raise ValueError(f"{name!r} is no name of a golden file: it is in the folder of the test")
        if not len(of.times):
            raise AssertionError(f"{whose}: no set-points")
        path = self._directory / f"{name}.csv.gz"
        found = table(of)
        if self._update:
            self._directory.mkdir(parents=True, exist_ok=True)
            path.write_bytes(packed(found))
            self.written.append(path)
            return
        if not path.exists():
            raise AssertionError(
                f"{path}: there is no such golden file; pytest {FLAG} makes it of this flight"
            )
        if said := difference(unpacked(path), found, within):
            raise AssertionError(f"{whose}: {said}; golden file {path} (pytest {FLAG} makes it anew)")


def table(of: Course) -> np.ndarray:
    """Return set-points as an array (n, 13), rounded as the file is.

    Columns: ms since the first, position, velocity and acceleration NED, yaw, mask and frame.
    """
    since = (of.times - (of.times[0] if len(of.times) else 0)) // _TIME_UNIT_US
    last = np.column_stack([of.yaw, of.masks, of.frames])
    columns = [since[:, None], of.positions, of.velocities, of.accelerations, last]
    result: np.ndarray = np.round(np.hstack(columns).astype(np.float64), _DIGITS)
    return result


def packed(values: np.ndarray) -> bytes:
    """Return the bytes of the file; the same values give the same bytes."""
    text = StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(_HEAD)
    rows.writerows([int(row[0]), *(f"{value:.{_DIGITS}f}" for value in row[1:])] for row in values)
    return gzip.compress(text.getvalue().encode(), mtime=0)


def unpacked(path: Path) -> np.ndarray:
    """Return the values of a file, (n, 13). Raises AssertionError if it is no golden file."""
    __tracebackhide__ = True
    try:
        rows = list(csv.reader(StringIO(gzip.decompress(path.read_bytes()).decode())))
        values = np.array(rows[1:], dtype=np.float64).reshape(-1, len(_HEAD))
    except (OSError, EOFError, ValueError) as error:
        raise AssertionError(f"{path}: is no golden file: {error}") from None
    if not rows or tuple(rows[0]) != _HEAD:
        raise AssertionError(f"{path}: is no golden file: its first line is not {', '.join(_HEAD)}")
    return values


def difference(golden: np.ndarray, found: np.ndarray, within: float) -> str:
    """Return where ``found`` first deviates from ``golden`` (n, 13), and where it deviates most.

    The text is empty if it never does.
    """
    count = min(len(golden), len(found))
    times = golden[:count, 0] != found[:count, 0]
    if times.any():
        k = int(times.argmax())
        return (
            f"the {k + 1}th set-point comes {found[k, 0] * 1e-3:.3f} s after the first, the golden one "
            f"{golden[k, 0] * 1e-3:.3f} s"
        )
    off = np.abs(found[:count, 1:] - golden[:count, 1:])
    # Yaw differences wrap around; a value that is NaN in both is no difference.
    off[:, _YAW] = np.abs((off[:, _YAW] + np.pi) % (2.0 * np.pi) - np.pi)
    off[:, _ACCELERATIONS] /= _ACCELERATION_FACTOR
    neither = np.isnan(found[:count, 1:]) & np.isnan(golden[:count, 1:])
    off = np.where(neither, 0.0, np.where(np.isnan(off), np.inf, off))
    wrong = off > within
    if wrong.any():
        rows = wrong.any(axis=1)
        first, worst = int(rows.argmax()), np.unravel_index(int(off.argmax()), off.shape)
        begins = _place(golden, found, off, first, int(off[first].argmax()))
        return (
            f"the set-points part {begins}, where {within:g} is allowed; "
            f"{int(rows.sum())} of {count} differ, most {_place(golden, found, off, *map(int, worst))}"
        )
    if len(golden) != len(found):
        return f"there are {len(found)} set-points, the golden file has {len(golden)}"
    return ""


def _place(golden: np.ndarray, found: np.ndarray, off: np.ndarray, row: int, column: int) -> str:
    apart = off[row, column] * (_ACCELERATION_FACTOR if column in range(9)[_ACCELERATIONS] else 1.0)
    now, before, unit = found[row, column + 1], golden[row, column + 1], _UNITS[column]
    values = f"{_NAMES[column]} {now:.4g} {unit}, golden {before:.4g} {unit}"
    return f"{found[row, 0] * 1e-3:.2f} s after the first: {values}, {apart:.4f} {unit} apart"
