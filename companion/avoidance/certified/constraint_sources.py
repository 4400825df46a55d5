"""What a certified plan keeps away from, on its own knots: the plans of those that share them, what stands,
and strangers."""

from __future__ import annotations

from math import hypot

import numpy as np

from companion.avoidance.certified.committed import horizon_of
from companion.avoidance.certified.margins import beside, between, fastest, margin
from companion.avoidance.certified.noncooperative import NonCooperative
from companion.avoidance.certified.peer_plans import PeerPlans
from companion.avoidance.certified.separating_planes import Others
from companion.config import CompanionConfig
from companion.config.obstacles import Post
from companion.obstacles.static import Axes, FixedObstacles
from companion.values.horizon import Array
from companion.world import View, World

_STEPS_OF_SIGHT = 1.0
"""m beyond what matters for certain, so that nothing comes into sight in the middle of a plan."""


class ConstraintSources:
    """Of one vehicle; ``around`` for each plan."""

    def __init__(self, config: CompanionConfig, steps: int) -> None:
        self._config, self._steps = config, steps
        own = config.certified
        self.between = between(own, config.field, config.limits)
        """Least distance (m) between two plans."""
        self._margin = margin(own, config.field, config.limits)
        self._beside = beside(own, config.field, config.limits)
        self._lost = config.guard.neighbour_lost_us
        self._posts = FixedObstacles(tuple(o for o in config.obstacles if isinstance(o, Post)))
        self._balls = FixedObstacles(tuple(o for o in config.obstacles if not isinstance(o, Post)))
        self._noncooperative = NonCooperative(config, steps)
        self._sight = steps * 1e-6 * own.dt_us * fastest(config.limits) + self.between + _STEPS_OF_SIGHT

    def around(
        self, now: int, epoch: int, own: Array, peers: PeerPlans, world: World, view: View
    ) -> tuple[Others, Array]:
        """All that counts for the plan that begins one epoch after ``epoch``, as known at ``now`` (µs), and
        the field f (n, 3), m/s², that it would rather yield to; ``own`` (n, 3, 3): the committed control
        points from there on."""
        plans = [filed.controls for filed in peers.plans(epoch).values()]
        aside = self._aside(now, peers, world)
        # On the way down it drifts; who is further off may be flown by somebody, at any height. Once silent
        # it counts as down where it was: what stands switched off on the ground is no danger that grows.
        taken = {system for system, (off, _, fresh) in aside.items() if fresh and off > self.between}
        members = peers.members.union(peers.left.keys() - taken)
        begins = epoch + self._config.certified.epoch_us
        seen = self._noncooperative.seen(begins, members, world)
        noncooperative = [
            *self._noncooperative.balls(seen, own),
            *self._noncooperative.target(now, begins, view),
        ]
        sensed = world.sensed.around(epoch, own.reshape(-1, 3), self._sight)
        ends = [filed.controls[-1, 2] for filed in peers.left.values()]
        down = [*ends, *(place for system, (_, place, _) in aside.items() if system not in taken)]
        alone = [*self._standing(own), *self._down(own, down), *noncooperative, *self._seen(sensed)]
        count, n = len(plans), self._steps
        controls = np.empty((count + len(alone), n, 3, 3))
        if plans:
            controls[:count] = _later(np.array(plans), self._config.certified.knots)
        distance = np.full((len(controls), n), self.between)
        for index, (centres, radii) in enumerate(alone, count):
            controls[index], distance[index] = centres, radii
        others = Others(controls, distance, np.arange(len(controls)) < count)
        return others, self._noncooperative.field(seen, own, sensed)

    def _standing(self, own: Array) -> list[tuple[Array, Array]]:
        """Spheres about their centres; posts beside the vehicle, whatever its height: they count as if they
        had no top."""
        points = own.reshape(-1, 3)
        found = []
        for fixed, upright in ((self._balls, False), (self._posts, True)):
            if not len(fixed):
                continue
            _, positions, radii = fixed.around(points, self._sight)
            for place, radius in zip(positions.reshape(-1, self._steps, 3, 3), radii, strict=True):
                centres = place.copy()
                if upright:
                    centres[..., 2] = own[..., 2]
                least = self._config.field.d_min + radius + self._margin
                found.append((centres, np.full(self._steps, least)))
        return found

    def _seen(self, sensed: Axes) -> list[tuple[Array, Array]]:
        """What sensors see, and the ways of traffic: kept clear of as if it stood. One that comes into sight
        within the committed plan is only yielded to."""
        least = self._config.field.d_min + self._margin
        places = sensed.positions.reshape(-1, self._steps, 3, 3)
        return [
            (place, np.full(self._steps, least + radius))
            for place, radius in zip(places, sensed.radius, strict=True)
        ]

    def _aside(self, now: int, peers: PeerPlans, world: World) -> dict[int, tuple[float, Array, bool]]:
        """Of those who said farewell and were heard since beside their last plan: how far (m) beside it,
        where (3,), and whether they are heard still. Heights do not count, and two estimates of one place
        differ, too."""
        found: dict[int, tuple[float, Array, bool]] = {}
        left = peers.left
        if not left:
            return found
        for system, time, position, _ in world.neighbours.last_heard():
            if system not in left or time < left[system].plan.epoch:
                continue
            apart = position - horizon_of(left[system].plan).at(time).position
            off = hypot(apart[0], apart[1])
            if off > self._beside:
                found[system] = off, position, now - time <= self._lost
        return found

    def _down(self, own: Array, places: list[Array]) -> list[tuple[Array, Array]]:
        """At ``places`` (3,) are those who said farewell, on the way down or on the ground: nobody flies over
        them."""
        found = []
        for place in places:
            centres = own.copy()
            centres[..., :2] = place[:2]
            found.append((centres, np.full(self._steps, self.between)))
        return found


def _later(controls: Array, knots: int) -> Array:
    """Control points (M, n, 3, 3) ``knots`` later; after the end they rest."""
    result = np.empty_like(controls)
    left = max(controls.shape[1] - knots, 0)
    result[:, :left] = controls[:, knots:]
    result[:, left:] = controls[:, -1:, 2:]
    return result
