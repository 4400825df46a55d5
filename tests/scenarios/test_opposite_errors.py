"""The margin between plans covers two position estimates that are off in opposite directions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.scenarios.lockstep_flights import Flown, fly, scenario

OFF = 1.78
"""m by which each estimate is off: less than k·σ = 1.80 m."""


def swapped(shift: float, off: tuple[float, float], directory: Path) -> Flown:
    """Two that swap head on over 28 m, with goals ``shift`` m to the left of the other's start.

    ``off`` (east, north), m: by how much GPS is off for the first; it is off by the opposite for the second.
    """
    jumps: list[dict[str, Any]] = [
        {"kind": "gps_jump", "vehicle": vehicle, "at_s": 0.0, "for_s": 60.0, "offset": [*offset, 0.0]}
        for vehicle, offset in ((11, off), (12, (-off[0], -off[1])))
    ]
    starts, goals = [[-14.0, 0.0, 5.0], [14.0, 0.0, 5.0]], [[14.0, shift, 5.0], [-14.0, -shift, 5.0]]
    change: dict[str, Any] = {
        "task": "goto",
        "vehicles": 2,
        "airborne": True,
        "sensors": "truth",
        "cap_s": 12.0,
        "starts": {"kind": "points", "at": starts, "goals": goals, "jitter": 0.0},
        "faults": jumps,
        "companion": {
            "avoidance": "certified",
            "turning_sense": "right",
            "field": {"position_sigma": 0.6},
        },
    }
    return fly(scenario("antipodal-8", change), 1, directory)


@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.0, 0.5, 1.0, 1.5])
def test_two_whose_estimates_are_off_towards_each_other_stay_apart(shift: float, tmp_path: Path) -> None:
    """They pass on the left if the goals lead them there, otherwise on the right."""
    off = (0.0, OFF if shift else -OFF)
    flown = swapped(shift, off, tmp_path)
    of, truth = flown.flight.scenario, flown.flight.truth
    assert truth.vehicles.minimum >= of.d_min
    # They passed each other, and the errors brought them nearer than any two plans may be.
    samples = truth.samples()
    assert samples.position[-1, 0, 0] > 10.0 > -10.0 > samples.position[-1, 1, 0]
    assert truth.vehicles.minimum < of.d_min + 2.0 * OFF
    assert flown.summary["anchored_anew"] == 0
    assert np.isfinite(samples.position).all()
