"""Results of each setting on each scene, and the best settings."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table

from benchmarks.integrators import Flown
from benchmarks.orca_settings import Setting
from outrider.sweep.statistics import plain

WIDTH = 120
_HEADS = ("converged", "median, s", "worst, s", "runs below", "below, s", "least separation, m")
_CAPTION = "r: radius, m · τ: horizon, s · turned right, ° · b: braking, m/s² · below: nearer than d_min"


class Row(NamedTuple):
    """Results of a setting on a scene.

    ``median_s`` is None if half of the ``runs`` or more did not converge; ``worst_s`` is the longest time of
    those that did; ``below`` counts runs in which a pair was closer than d_min by more than 1 mm; ``below_s``
    is the time for which that was so, in all runs together.
    """

    scene: str
    setting: Setting
    runs: int
    converged: int
    median_s: float | None
    worst_s: float | None
    below: int
    separation_m: float
    below_s: float

    def document(self) -> dict[str, Any]:
        """Return the row as values of JSON."""
        return {**self._asdict(), "setting": self.setting._asdict()}


def row_of(scene: str, setting: Setting, flights: Sequence[Flown]) -> Row:
    """Combine the flights of a setting as ``outrider paper`` combines the runs of a row."""
    times = [inf if flight.converged_s is None else flight.converged_s for flight in flights]
    done = [time for time in times if time < inf]
    return Row(
        scene,
        setting,
        len(flights),
        len(done),
        plain(times, 0.5),
        max(done, default=None),
        sum(flight.below_s > 0.0 for flight in flights),
        round(min(flight.separation_m for flight in flights), 4),
        round(sum(flight.below_s for flight in flights), 2),
    )


def ranked(rows: Sequence[Row]) -> list[Row]:
    """Return the rows, the best first."""
    return sorted(rows, key=lambda row: _merit([row]))


def one_for_all(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of the setting that is best on all scenes together."""
    settings = dict.fromkeys(row.setting for row in rows)
    return min(([row for row in rows if row.setting == setting] for setting in settings), key=_merit)


def show(rows: Sequence[Row], top: int | None) -> None:
    """Write a table for each scene to standard output, with its ``top`` settings or all.

    A last table shows the setting that is best on all scenes.
    """
    console = Console()
    if not console.is_terminal:
        console.width = WIDTH
    for scene in dict.fromkeys(row.scene for row in rows):
        of_scene = ranked([row for row in rows if row.scene == scene])
        console.print(_table(f"ORCA, {scene}, the best first", of_scene[:top], "setting"))
    overall = one_for_all(rows)
    console.print(_table(f"ORCA, one setting for all: {_said(overall[0].setting)}", overall, "scene"))


def _table(title: str, rows: Sequence[Row], first: str) -> Table:
    table = Table(title=title, caption=_CAPTION)
    table.add_column(first)
    for head in _HEADS:
        table.add_column(head, justify="right")
    for row in rows:
        table.add_row(row.scene if first == "scene" else _said(row.setting), *_words(row))
    return table


def _merit(rows: Sequence[Row]) -> tuple[int, float, float]:
    """Return the merit of rows, less is better.

    Runs that did not converge or violated d_min count first, then the median time, then the worst time.
    """
    return (
        sum(row.runs - row.converged + row.below for row in rows),
        sum(inf if row.median_s is None else row.median_s for row in rows),
        sum(inf if row.worst_s is None else row.worst_s for row in rows),
    )


def _said(setting: Setting) -> str:
    return (
        f"r {setting.radius_m:.2f}, τ {setting.horizon_s:.1f}, {setting.turned_deg:2.0f}°, "
        f"b {setting.braking:.1f}"
    )


def _words(row: Row) -> tuple[str, ...]:
    return (
        f"{row.converged} of {row.runs}",
        _seconds(row.median_s),
        _seconds(row.worst_s),
        str(row.below),
        f"{row.below_s:.2f}",
        f"{row.separation_m:.3f}",
    )


def _seconds(value: float | None) -> str:
    return "never" if value is None else f"{value:.2f}"
