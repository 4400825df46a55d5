"""Picture of a comparison: a panel for each row with the paths and the outlines of the obstacles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.patches import Circle, Rectangle

from companion.config.obstacles import Box, Post, Wall
from outrider.compare.picture import Paths, draw
from tests.outrider.saved_figures import saved_figures

WALL = Wall(kind="wall", ends=((-2.0, 1.0), (2.0, 1.0)), thickness=0.2, height=3.0)
POST = Post(kind="post", at=(1.0, -1.0), radius=0.4, height=5.0)
BOX = Box(kind="box", at=(0.0, -3.0, 1.0), size=(2.0, 1.0, 2.0), yaw_deg=90.0)


def test_paths_and_obstacles_are_where_they_were(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = saved_figures(monkeypatch)
    trace = np.array([[[0, 0, 1], [5, 0, 1]], [[1, 2, 1], [4, 2, 1]], [[2, 4, 1], [3, 4, 1]]], dtype=float)
    path = tmp_path / "compare.png"
    ball = np.array([[[6.0, 0.0, 1.0]], [[6.0, 1.0, 1.0]], [[6.0, 2.0, 1.0]]])
    blocked = Paths(trace, (WALL, POST, BOX), ball, [0.3])
    draw("two rows", {"open": Paths(trace), "blocked": blocked}, path)
    assert path.read_bytes().startswith(b"\x89PNG")
    (figure,) = drawn
    free, among = figure.axes
    assert (free.get_title(), among.get_title()) == ("open", "blocked")
    for axes, of in ((free, trace), (among, ball)):
        first, *_ = axes.get_lines()
        np.testing.assert_array_equal(first.get_xydata(), of[:, 0, :2])
    assert not free.patches
    wall, post, box, last = among.patches
    assert isinstance(last, Circle)
    assert (last.center, last.radius) == ((6.0, 2.0), 0.3)
    assert isinstance(post, Circle)
    assert (post.center, post.radius) == ((1.0, -1.0), 0.4)
    for patch, low, high in ((wall, (-2.0, 0.9), (2.0, 1.1)), (box, (-0.5, -4.0), (0.5, -2.0))):
        assert isinstance(patch, Rectangle)
        corners = patch.get_corners()
        np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], [low, high], atol=1e-9)
