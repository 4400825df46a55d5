"""The picture of a run, of however many vehicles: a warning of the library that draws is an error."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from outrider.runs.figures import draw
from outrider.runs.ground_truth import Samples
from outrider.runs.outcome import Outcome
from tests.outrider.saved_figures import saved_figures
from tests.outrider.shipped import scenario


def circling(vehicles: int, count: int = 60) -> Samples:
    """Each a bit further round a circle of 20 m, a sample every 20 ms."""
    time = np.arange(count, dtype=np.int64) * 20_000
    angle = np.linspace(0.0, 2.0 * np.pi, vehicles, endpoint=False) + 1e-6 * time[:, None]
    place = np.stack([20.0 * np.cos(angle), 20.0 * np.sin(angle), np.full_like(angle, 5.0)], axis=2)
    flat, still = np.zeros((count, vehicles)), np.empty((count, 0, 3))
    target, apart = np.zeros((count, 3)), np.full(count, 4.0)
    return Samples(time, place, place, place, place, place, flat, flat, target, apart, still)


def flown(vehicles: int, **changes: Any) -> Outcome:
    """All that a picture asks of a flight."""
    samples = circling(vehicles)
    flight: Any = SimpleNamespace(
        truth=SimpleNamespace(samples=lambda: samples),
        scenario=scenario("antipodal", vehicles=max(vehicles, 2), **changes),
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


@pytest.fixture
def drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Figure]:
    """Draws a flight, and gives the figure."""
    found = saved_figures(monkeypatch)

    def call(flight: Outcome, motion: str = "multirotor") -> Figure:
        said = {"avoidance": "field", "method": "tangential", "converged": None, "motion": motion}
        said |= {"min_separation_m": 4.0, "d_min_violations": 0}
        draw(flight, said, tmp_path / "flight.png")
        return found[-1]

    return call


def test_boxes_and_walls_are_drawn_where_they_stand(drawn: Callable[..., Figure]) -> None:
    box = {"kind": "box", "at": [4.0, 1.0, 2.0], "size": [2.0, 1.0, 4.0], "yaw_deg": 90.0}
    wall = {"kind": "wall", "ends": [[-3.0, -4.0], [0.0, 0.0]], "thickness": 0.5}
    post = {"kind": "post", "at": [0.0, 8.0], "radius": 0.5}
    axes = drawn(flown(3, obstacles=[box, post, wall])).axes[0]
    (boxes,) = (one for one in axes.collections if isinstance(one, PolyCollection))
    corners = [[4.5, 0.0], [4.5, 2.0], [3.5, 2.0], [3.5, 0.0]]
    ends = [[-2.8, -4.15], [0.2, -0.15], [-0.2, 0.15], [-3.2, -3.85]]
    for path, expected in zip(boxes.get_paths(), (corners, ends), strict=True):
        np.testing.assert_allclose(path.vertices[:4], expected, atol=1e-9)
    (circle,) = (one for one in axes.patches if isinstance(one, Circle))
    assert (circle.center, circle.radius) == ((0.0, 8.0), 0.5)


@pytest.mark.parametrize("motion", ["multirotor", "point"])
def test_a_flight_of_points_is_marked_as_such(motion: str, drawn: Callable[..., Figure]) -> None:
    title = drawn(flown(1), motion).get_suptitle()
    assert ("points, no physics" in title) is (motion == "point")


def test_a_world_that_is_larger_than_the_flight_does_not_make_it_small(
    drawn: Callable[..., Figure],
) -> None:
    """The flight is 40 m wide: what is 20 m beside it is in the picture, and what is far away is not."""
    near = {"kind": "box", "at": [35.0, 0.0, 2.0], "size": [2.0, 1.0, 4.0]}
    far = {"kind": "box", "at": [900.0, 0.0, 2.0], "size": [2.0, 1.0, 4.0]}
    _, right = drawn(flown(8, obstacles=[near])).axes[0].get_xlim()
    _, with_far = drawn(flown(8, obstacles=[near, far])).axes[0].get_xlim()
    assert right == with_far
    assert right > 36.0


@pytest.mark.parametrize("vehicles", [1, 24, 25, pytest.param(200, marks=pytest.mark.slow)])
def test_every_path_is_drawn_and_few_are_named(vehicles: int, drawn: Callable[..., Figure]) -> None:
    figure = drawn(flown(vehicles))
    paths = figure.axes[0]
    ways = [line for line in paths.lines if len(line.get_xdata()) == 60 and line.get_marker() == "None"]
    assert len(ways) >= vehicles
    legend = paths.get_legend()
    assert legend is not None
    names = [text.get_text() for text in legend.get_texts()]
    assert covering(figure) == []
    assert names == [*([str(11 + k) for k in range(vehicles)] if vehicles <= 24 else []), "target"]
