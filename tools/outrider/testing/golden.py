"""Golden files: the set-points of a flight that was looked at and found good, as text that a diff can
show."""

from __future__ import annotations

import csv
import gzip
from io import StringIO
from pathlib import Path

import numpy as np

from outrider.replaying.setpoints import Course

FLAG = "--update-golden"
_HEAD = ("time_ms", "north_m", "east_m", "down_m", "v_north_m_s", "v_east_m_s", "v_down_m_s", "yaw_rad")
_NAMES = ("north", "east", "down", "velocity north", "velocity east", "velocity down", "yaw")
_UNITS = ("m", "m", "m", "m/s", "m/s", "m/s", "rad")
_DIGITS = 4
_EVERY = 1_000
"""µs: times are told to the millisecond."""


class Golden:
    """The golden files in ``directory``; ``update``: write instead of compare."""

    def __init__(self, directory: Path, *, update: bool) -> None:
        self._directory, self._update = directory, update
        self.written: list[Path] = []

    def check(self, name: str, whose: str, of: Course, within: float) -> None:
        """AssertionError, which says where and by how much, if the set-points ``of`` are not those of the
        file ``name``. See ``Setpoints.assert_golden``."""
        __tracebackhide__ = True
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
    """(n, 8): ms since the first, position and velocity NED, yaw; rounded as the file is."""
    since = (of.times - (of.times[0] if len(of.times) else 0)) // _EVERY
    columns = [since[:, None], of.positions, of.velocities, of.yaw[:, None]]
    result: np.ndarray = np.round(np.hstack(columns).astype(np.float64), _DIGITS)
    return result


def packed(values: np.ndarray) -> bytes:
    """The file; the same values give the same bytes."""
    text = StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(_HEAD)
    rows.writerows([int(row[0]), *(f"{value:.{_DIGITS}f}" for value in row[1:])] for row in values)
    return gzip.compress(text.getvalue().encode(), mtime=0)


def unpacked(path: Path) -> np.ndarray:
    """The values of a file, (n, 8). AssertionError if it is none."""
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
    """Where ``found`` first leaves ``golden`` (n, 8), and where it is furthest off; empty if it never
    does."""
    count = min(len(golden), len(found))
    times = golden[:count, 0] != found[:count, 0]
    if times.any():
        k = int(times.argmax())
        return (
            f"the {k + 1}th set-point comes {found[k, 0] * 1e-3:.3f} s after the first, the golden one "
            f"{golden[k, 0] * 1e-3:.3f} s"
        )
    off = np.abs(found[:count, 1:] - golden[:count, 1:])
    # An angle has no ends; and what neither has is no difference.
    off[:, -1] = np.abs((off[:, -1] + np.pi) % (2.0 * np.pi) - np.pi)
    neither = np.isnan(found[:count, 1:]) & np.isnan(golden[:count, 1:])
    off = np.where(neither, 0.0, np.where(np.isnan(off), np.inf, off))
    wrong = off > within
    if wrong.any():
        rows = wrong.any(axis=1)
        first, worst = int(rows.argmax()), np.unravel_index(int(off.argmax()), off.shape)
        begins = _place(golden, found, first, int(off[first].argmax()))
        return (
            f"the set-points part {begins}, where {within:g} is allowed; "
            f"{int(rows.sum())} of {count} differ, most {_place(golden, found, *map(int, worst))}"
        )
    if len(golden) != len(found):
        return f"there are {len(found)} set-points, the golden file has {len(golden)}"
    return ""


def _place(golden: np.ndarray, found: np.ndarray, row: int, column: int) -> str:
    now, before, unit = found[row, column + 1], golden[row, column + 1], _UNITS[column]
    values = f"{_NAMES[column]} {now:.3f} {unit}, golden {before:.3f} {unit}"
    return f"{found[row, 0] * 1e-3:.2f} s after the first: {values}, {abs(now - before):.3f} {unit} apart"
