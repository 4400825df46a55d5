"""Trails of vehicles: line segments in chunks, so that only the newest chunk is sent again."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from outrider.scene.snapshot import Single

if TYPE_CHECKING:
    import viser

EVERY = 0.1
"""Time (s) between two points of a trail."""
CHUNK = 40
"""Number of points of a chunk."""
LENGTH = 25.0
"""Time (s) for which a trail is shown; chunks make it slightly longer."""
GAP = 1.0
"""Time (s) without a snapshot after which a new trail starts."""


class Trails:
    """Trails below ``name`` on ``stage``, with a colour (K, 3) for each vehicle."""

    def __init__(self, stage: viser.SceneApi, name: str, colours: NDArray[np.uint8], width: float) -> None:
        self._stage, self._name, self._width = stage, name, width
        self._colours = colours
        self._chunks: deque[tuple[float, viser.LineSegmentsHandle]] = deque()
        self._points: list[Single] = []
        self._last: float | None = None
        self._count = 0
        self.visible = True

    def see(self, time: float, places: Single) -> None:
        """Add the positions ``places`` (K, 3) at ``time`` (s).

        The trails are cleared if ``time`` is before the last, or more than GAP after it.
        """
        if self._last is not None and not 0.0 <= time - self._last <= GAP:
            self.clear()
        if self._last is not None and time - self._last < EVERY:
            return
        self._last = time
        self._points.append(places)
        if len(self._points) > CHUNK:
            self._points = self._points[-2:]
            self._chunks.append(self._new(time))
        elif len(self._points) == 2 and not self._chunks:
            self._chunks.append(self._new(time))
        elif len(self._points) > 1:
            handle = self._chunks[-1][1]
            points, colours = self._segments()
            self._chunks[-1] = time, handle
            handle.colors = colours
            handle.points = points
        while self._chunks and time - self._chunks[0][0] > LENGTH:
            self._chunks.popleft()[1].remove()

    def clear(self) -> None:
        """Remove all trails."""
        while self._chunks:
            self._chunks.popleft()[1].remove()
        self._points.clear()
        self._last = None

    def show(self, visible: bool) -> None:
        """Show or hide the trails."""
        self.visible = visible
        for _, handle in self._chunks:
            handle.visible = visible

    def _new(self, _time: float) -> tuple[float, viser.LineSegmentsHandle]:
        points, colours = self._segments()
        self._count += 1
        handle = self._stage.add_line_segments(
            f"{self._name}/{self._count}",
            points,
            colours,
            thickness=self._width,
            thickness_units="screen",
            visible=self.visible,
        )
        return _time, handle

    def _segments(self) -> tuple[Single, NDArray[np.uint8]]:
        places = np.array(self._points, dtype=np.float32)
        points = np.stack([places[:-1], places[1:]], axis=2)
        colours = np.broadcast_to(self._colours[None, :, None], points.shape)
        there = np.isfinite(points).all(axis=(2, 3))
        return points[there], np.ascontiguousarray(colours[there])
