"""Finished flight: its summary, its true motion as arrays, its report and its table."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from outrider.errors import InputError, OutriderError
from outrider.runs import names
from outrider.runs.arrays import Motion, Single, read_motion
from outrider.runs.configuration import Resolved, resolved
from outrider.runs.directories import new_directory
from outrider.runs.summary import Value

if TYPE_CHECKING:
    from pandas import DataFrame

_AXES = ("east", "north", "up")


class Flight:
    """Flight that has been flown: T samples (50 Hz) of K vehicles, ENU, SI; missing values are NaN.

    ``directory`` holds its files: logs, configuration, summary, picture and arrays. Raises InputError if it
    is no run directory.
    """

    def __init__(self, directory: str | Path) -> None:
        self.directory = Path(directory)
        of: Resolved = resolved(self.directory, "allowed: what a flight of a scenario left")
        self.scenario, self.seed = of.scenario, of.seed
        self.systems: tuple[int, ...] = tuple(of.scenario.systems)
        """System ids of the vehicles, (K,)."""

    @cached_property
    def summary(self) -> Mapping[str, Value]:
        """The summary, see docs/summary.md. Raises InputError if the flight has not been finished."""
        path = self.directory / names.SUMMARY
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            found = None
        if not isinstance(found, dict):
            raise InputError(f"{path}: holds no summary; allowed: the directory of a finished flight")
        return found

    @cached_property
    def _motion(self) -> Motion:
        found = read_motion(self.directory / names.FLIGHT, len(self.systems), len(self.scenario.moving))
        if found is None:
            raise InputError(f"{self.directory}: holds no {names.FLIGHT}; allowed: a finished flight")
        return found

    @property
    def times(self) -> np.ndarray:
        """Times (T,) after the goal event, s."""
        return self._motion.time_s

    @property
    def positions(self) -> Single:
        """True positions (T, K, 3), m."""
        return self._motion.position

    @property
    def velocities(self) -> Single:
        """True velocities (T, K, 3), m/s."""
        return self._motion.velocity

    @property
    def references(self) -> Single:
        """Positions (T, K, 3), m, that the autopilots track."""
        return self._motion.reference

    @property
    def yaws(self) -> Single:
        """True yaws (T, K), rad, counter-clockwise from east."""
        return self._motion.yaw

    @property
    def target(self) -> Single:
        """True positions of the target (T, 3), m."""
        return self._motion.target

    @property
    def moving(self) -> Single:
        """Positions of the moving obstacles (T, M, 3), m."""
        return self._motion.moving

    @property
    def separation(self) -> Single:
        """Least distance (T,), m, between two vehicles in the air since the last sample; ∞ without a pair."""
        return self._motion.separation

    def to_html(self, path: str | Path | None = None) -> Path:
        """Write the report, one page that needs no network, and return its path.

        It goes to ``path``, by default to ``report.html`` in the directory. Raises InputError if another file
        is there.
        """
        from outrider.report import command as report

        place = self.directory / report.NAME if path is None else Path(path)
        report.check(place)
        report.write(place, report.make(self.directory).text)
        return place

    def to_pandas(self) -> DataFrame:
        """Return a table with a row for each sample and vehicle: ``time_s``, ``system``, motion and target.

        Raises OutriderError without pandas (extra ``pandas``).
        """
        try:
            from pandas import DataFrame
        except ModuleNotFoundError:
            raise OutriderError("to_pandas needs pandas: pip install pandas") from None
        count, motion = len(self.systems), self._motion
        columns: dict[str, Any] = {
            "time_s": np.repeat(motion.time_s, count),
            "system": np.tile(motion.system, len(motion.time_s)),
        }
        for name, values in (("", motion.position), ("v_", motion.velocity)):
            for axis, word in enumerate(_AXES):
                unit = "_m_s" if name else "_m"
                columns[f"{name}{word}{unit}"] = values[..., axis].ravel()
        columns["yaw_rad"], columns["tilt_rad"] = motion.yaw.ravel(), motion.tilt.ravel()
        for axis, word in enumerate(_AXES):
            columns[f"target_{word}_m"] = np.repeat(motion.target[:, axis], count)
        columns["separation_m"] = np.repeat(motion.separation, count)
        return DataFrame(columns)

    def save(self, directory: str | Path) -> Path:
        """Copy all files to a new ``directory`` and return it. Raises InputError if something is there."""
        place = new_directory(Path(directory), "")
        shutil.copytree(self.directory, place, dirs_exist_ok=True)
        return place

    def _repr_html_(self) -> str:
        """Return the report for a notebook, in a frame of its own."""
        page = self.to_html().read_text(encoding="utf-8")
        return f'<iframe srcdoc="{escape(page, quote=True)}" width="100%" height="700"></iframe>'

    def __repr__(self) -> str:
        summary = self.summary
        least = summary["min_separation_m"]
        apart = f", at least {least} m apart" if least is not None else ""
        return f"Flight({self.scenario.name}, seed {self.seed}: {len(self.systems)} vehicles{apart})"
