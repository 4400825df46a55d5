"""What a companion loads before it flies."""

from __future__ import annotations

import subprocess
import sys

SHOW = "import sys, companion.node; print(*sys.modules)"


def test_the_companion_is_there_without_waiting_for_scipy():
    """filterpy loads scipy.stats, which takes longer than all the rest: only who has a track needs it."""
    done = subprocess.run([sys.executable, "-c", SHOW], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert {"companion", "mavlink_bridge", "numba", "numpy"} <= loaded
    assert not loaded & {"filterpy", "scipy.stats", "matplotlib", "jsbsim", "sitl", "outrider"}
