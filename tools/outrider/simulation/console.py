"""Console output: progress on standard error, tables on standard output."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from outrider.runs.summary import Value
from outrider.simulation.conductor import Stage
from outrider.terminal.lines import say
from outrider.terminal.progress_lines import ProgressLines
from outrider.terminal.time_left import TimeLeft, duration

_REFRESH_S = 0.1
_LONG_S = 180.0
"""Wall time (s) of a flight from which on it is announced."""
_WORDS = {
    "converged": "converged",
    "convergence_time_s": "convergence time, s",
    "min_separation_m": "least separation, m",
    "min_target_distance_m": "least distance to the target, m",
    "min_obstacle_distance_m": "least distance to an obstacle, m",
    "d_min_m": "d_min, m",
    "span_m": "vehicle tip to tip, m",
    "motion": "vehicles are",
    "d_min_violations": "violations of d_min",
    "standoff_error_m": "stand-off error, m",
    "yaw_error_deg": "yaw error, deg",
    "tracking_error_m": "tracking error, m",
    "estimate_error_m": "estimate's error, m",
    "max_speed_m_s": "largest speed, m/s",
    "max_acceleration_m_s2": "largest acceleration, m/s²",
    "max_tilt_deg": "largest tilt, deg",
    "turning_sense": "turning sense",
    "plan_ms": "CPU time of a plan, ms",
    "plans": "plans",
    "solver_failures": "solver failures",
    "held_epochs": "held plans",
    "messages": "messages",
    "deadline_misses": "missed deadlines",
    "deadline_steps": "of so many deadlines",
    "lateness_ms": "lateness of the control, ms",
    "simulated_s": "simulated, s",
    "wall_s": "wall, s",
    "real_time_factor": "real-time factor",
    "failure": "failure",
    "run_dir": "run directory",
}


@contextmanager
def progress(duration_s: float) -> Iterator[Callable[[Stage, float], None]]:
    """Show a progress bar of one flight; without a terminal, a line now and then.

    Yields a function that takes stage and simulated seconds. No thread is used, because a flight in real time
    forks while the bar is shown.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[seconds]:6.1f} s simulated"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
    )
    console = Console(stderr=True)
    off = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=off, auto_refresh=False) as bar:
        task = bar.add_task(Stage.PREPARE.value, total=duration_s, seconds=0.0, left="")
        shown = 0.0
        lines, time_left, warned = ProgressLines(), TimeLeft(), False

        def left(stage: Stage, seconds: float) -> str:
            """Return how long the flight takes at most, and say so at once if that is long."""
            nonlocal warned
            if stage is not Stage.CLOCK:
                return ""
            words, most = time_left.words(seconds / duration_s), time_left.seconds(seconds / duration_s)
            if most is not None and most > _LONG_S and not warned:
                warned = True
                say(f"this flight takes up to {duration(most)}; less if its goal is reached earlier")
            return words

        def watch(stage: Stage, seconds: float) -> None:
            nonlocal shown
            now = time.monotonic()
            if now - shown < _REFRESH_S:
                return
            shown = now
            rest = left(stage, seconds)
            if off:
                lines.say(lambda: f"{stage.value}: {seconds:.1f} s simulated{rest and ', at most ' + rest}")
                return
            done = min(seconds, duration_s) if stage is not Stage.PREPARE else 0.0
            bar.update(
                task,
                description=f"{stage.value:9}",
                completed=done,
                seconds=seconds,
                left=rest,
                refresh=True,
            )

        yield watch


def show(summary: Mapping[str, Value]) -> None:
    """Show the summary as a table; keys without a value are left out."""
    way = "certified" if summary["avoidance"] == "certified" else summary["method"]
    table = Table(title=f"{summary['scenario']} · {way} · seed {summary['seed']}", show_header=False)
    for key, words in _WORDS.items():
        value = summary.get(key)
        if key == "motion":
            # Multirotors are the usual; a point is named because its figures are those of plans.
            value = "points, without physics" if value == "point" else None
        if value is None or value == "" or (isinstance(value, dict) and set(value.values()) == {None}):
            continue
        table.add_row(words, _text(value))
    Console().print(table)


def show_bench(figures: Mapping[str, object]) -> None:
    """Show the benchmark as a table."""
    table = Table(title="outrider bench", show_header=False)
    for key, value in figures.items():
        table.add_row(key, _text(value))
    Console().print(table)


def show_ratios(rows: Sequence[tuple[str, float, float, float]]) -> None:
    """Show figures of an earlier benchmark beside the present ones: name, before, now and ratio."""
    table = Table("figure", "before", "now", "ratio", title="compared")
    for name, before, now, ratio in rows:
        table.add_row(name, f"{before:g}", f"{now:g}", f"{ratio:.2f}")
    Console().print(table)


def _text(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {_text(part)}" for name, part in value.items())
    return f"{value:g}" if isinstance(value, float) else str(value)
