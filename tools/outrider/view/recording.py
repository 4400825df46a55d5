"""Recording of a run as one HTML file that plays in any browser without a network."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from outrider.view.page_server import PageServer
from outrider.view.player import Player
from outrider.view.renderer import Renderer

EVERY = 0.1
"""Time (s) between two pictures."""


def html(player: Player, watch: Callable[[str, float], None]) -> str:
    """Return the HTML of the whole run of ``player``, at its own speed, without the table and the plot."""
    page_server = PageServer("127.0.0.1", 0)
    try:
        stage = Renderer(page_server.server, player.scene)
        begin, end = player.span
        stage.show(player.moment(begin))
        recording = page_server.server.get_scene_serializer()
        for time in np.arange(begin, end, EVERY).tolist():
            stage.show(player.moment(time))
            recording.insert_sleep(EVERY)
            watch("drawing", (time - begin) / max(end - begin, EVERY))
        return recording.as_html()
    finally:
        page_server.stop()
