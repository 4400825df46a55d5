"""Range of the swarm link of a lock-step flight, by true positions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mavlink_bridge.frames import enu_to_ned
from mavlink_bridge.network.radio_range import Places, RadioRange
from outrider.runs import names
from outrider.simulation.moving import MovingObstacle
from sitl.node import Autopilot


def swarm_range(most: float, autopilots: Sequence[Autopilot], moving: Sequence[MovingObstacle]) -> RadioRange:
    """Return the range of ``most`` (m) between the companions of ``autopilots`` and ``moving`` obstacles.

    A companion is where its vehicle truly is after the last physics step.
    """
    who = [names.companion(one.config.system_id) for one in autopilots]
    who += [names.moving(one.system) for one in moving]

    def places(now: int) -> Places:
        found = [one.state.position for one in autopilots]
        return np.array(found + [enu_to_ned(one.position(now)) for one in moving])

    return RadioRange(most, who, places)
