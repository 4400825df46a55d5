"""The picture of a run, of however many vehicles: a warning of the library that draws is an error."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from matplotlib.figure import Figure

from outrider.runs.figures import draw
from outrider.runs.ground_truth import Samples
from outrider.runs.outcome import Outcome
from tests.outrider.shipped import scenario


def circling(vehicles: int, count: int = 60) -> Samples:
    """Each a bit further round a circle of 20 m, a sample every 20 ms."""
    time = np.arange(count, dtype=np.int64) * 20_000
    angle = np.linspace(0.0, 2.0 * np.pi, vehicles, endpoint=False) + 1e-6 * time[:, None]
    place = np.stack([20.0 * np.cos(angle), 20.0 * np.sin(angle), np.full_like(angle, 5.0)], axis=2)
    flat, still = np.zeros((count, vehicles)), np.empty((count, 0, 3))
    target, apart = np.zeros((count, 3)), np.full(count, 4.0)
    return Samples(time, place, place, place, place, place, flat, flat, target, apart, still)


def flown(vehicles: int) -> Outcome:
    """All that a picture asks of a flight."""
    samples = circling(vehicles)
    flight: Any = SimpleNamespace(
        truth=SimpleNamespace(samples=lambda: samples),
        scenario=scenario("antipodal", vehicles=max(vehicles, 2)),
        systems=tuple(range(11, 11 + vehicles)),
        target_system=10,
        starts=SimpleNamespace(goals=None),
        seed=1,
        span=0.63,
        clock_start=200_000,
        clock_end=1_000_000,
        plan_logs=[],
        tallies=[],
    )
    return cast("Outcome", flight)


def covering(figure: Figure) -> list[str]:
    """The axes whose data a legend of the figure covers."""
    figure.canvas.draw()
    found = []
    for legend in (axes.get_legend() for axes in figure.axes if axes.get_legend() is not None):
        box = legend.get_window_extent().shrunk(0.98, 0.98)
        found += [axes.get_title() for axes in figure.axes if box.overlaps(axes.get_window_extent())]
    return found


@pytest.mark.parametrize("vehicles", [1, 8, 24, 25, pytest.param(200, marks=pytest.mark.slow)])
def test_every_path_is_drawn_and_few_are_named(
    vehicles: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Figure] = []
    save = Figure.savefig

    def kept(figure: Figure, *arguments: Any, **more: Any) -> None:
        drawn.append(figure)
        save(figure, *arguments, **more)

    monkeypatch.setattr(Figure, "savefig", kept)
    said = {"avoidance": "field", "method": "tangential", "converged": None}
    said |= {"min_separation_m": 4.0, "d_min_violations": 0}
    draw(flown(vehicles), said, tmp_path / "flight.png")
    paths = drawn[0].axes[0]
    ways = [line for line in paths.lines if len(line.get_xdata()) == 60 and line.get_marker() == "None"]
    assert len(ways) >= vehicles
    legend = paths.get_legend()
    assert legend is not None
    names = [text.get_text() for text in legend.get_texts()]
    assert covering(drawn[0]) == []
    assert names == [*([str(11 + k) for k in range(vehicles)] if vehicles <= 24 else []), "target"]
