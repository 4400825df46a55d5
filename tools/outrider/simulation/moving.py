"""Moving obstacle as a node.

On the swarm link it sends its position and, with ``shares_plan``, its trajectory. It receives nothing and
does not give way.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from companion.telemetry.sharing import plan_message
from companion.values.horizon import Horizon, roll_out
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.plan import KNOTS
from outrider.runs import names
from outrider.scenarios.moving import MovingPart
from outrider.simulation.beacon import Beacon
from outrider.simulation.paths import Array, ClosedPath, Motion, Walk

LINK = "swarm"
STEP = 100_000
"""µs between the knots of a plan."""


class MovingObstacle:
    """Obstacle on a closed path from the goal event on; until then it stands at the path's beginning."""

    def __init__(self, config: MovingPart, system: int, fleet: FleetFrame) -> None:
        self.name = names.moving(system)
        self.system = system
        self.walk = Walk(ClosedPath(config.places), config.speed, config.setting_out)
        self._shares_plan = config.shares_plan
        self._fleet = fleet
        self._beacon = Beacon(system, LINK, config.rate_hz, fleet)

    def begin(self, now: int) -> None:
        """Start at the goal event."""
        self.walk.begin(now)

    def motion(self, now: int) -> Motion:
        """Return the true position and velocity at ``now`` (µs)."""
        return self.walk.motion(now)

    def position(self, now: int) -> Array:
        """Return the true position at ``now`` (µs)."""
        return self.walk.motion(now).position

    def horizon(self, now: int) -> Horizon:
        """Return the trajectory from ``now`` (µs) on.

        Its velocities at the knots are those of the path; its positions deviate from the path by millimetres.
        """
        motions = [self.walk.motion(now + n * STEP) for n in range(KNOTS + 1)]
        accelerations = np.diff([motion.velocity for motion in motions], axis=0) / (1e-6 * STEP)
        return roll_out(now, STEP, motions[0].position, motions[0].velocity, accelerations)

    def step(self, now: int, inbox: Sequence[Datagram]) -> list[Datagram]:
        """Send position and velocity, and the plan if it is shared, at the configured rate."""
        if not self._beacon.due(now):
            return []
        plan = None
        if self._shares_plan:
            plan = plan_message(self.horizon(now), self._beacon.source, self._fleet)
        return self._beacon.say(now, self.walk.motion(now), plan)


def places(moving: Sequence[MovingObstacle], times: Iterable[int]) -> Array:
    """Return the true positions (n, M, 3) at ``times`` (µs), ENU."""
    when = np.fromiter(times, dtype=np.int64)
    if not moving:
        return np.empty((len(when), 0, 3))
    return np.stack([one.walk.places(when) for one in moving], axis=1)
