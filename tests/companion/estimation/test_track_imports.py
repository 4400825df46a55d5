"""What a companion loads before it flies."""

from __future__ import annotations

import subprocess
import sys

SHOW = """
import sys, numpy
from companion.config import CompanionConfig
from companion.estimation.tracks import Track
from companion.node import Companion
from mavlink_bridge.frames import FleetFrame
post = {"kind": "post", "at": [4.0, 0.0], "radius": 0.3}
for settings in ({"obstacles": [post]}, {"way": {}}):
    for avoidance in ("field", "certified"):
        config = CompanionConfig.model_validate({**settings, "avoidance": avoidance})
        Companion(config, 11, 1, FleetFrame(47.0, 8.0, 400.0), lambda: 0)
track = Track(CompanionConfig().own)
assert all(track.measure(k * 20_000, numpy.zeros(3), numpy.zeros(3)) for k in range(1, 4))
print(*sys.modules)
"""


def test_a_companion_with_a_track_loads_no_scipy():
    """scipy.stats and scipy.linalg take longer than the rest of a start; numba loads scipy's top level."""
    done = subprocess.run([sys.executable, "-c", SHOW], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert {"companion", "mavlink_bridge", "numba", "numpy"} <= loaded
    slow = {"filterpy", "scipy.stats", "scipy.linalg", "matplotlib"}
    assert not loaded & (slow | {"jsbsim", "sitl", "outrider"})
    # Nor the search of ways, without obstacles or without the setting.
    assert "companion.ways" in loaded
    assert not loaded & {"companion.ways.way", "companion.ways.search", "companion.ways.lines"}
