"""A method of your own in the paper's field: a no-fly column pushes the plan to the left.

A method sees the scene of each plan and changes the field f, which shifts the bounds of the plan's
acceleration (docs/paper.md).
"""

import numpy as np

from outrider import Influence, Planner, PlannerConfig, Scene


class KeepLeftOf:
    """Push to the left (m/s²), fading with the distance from a vertical line, while it is ahead."""

    def __init__(self, east: float, north: float, reach: float, push: float) -> None:
        self.axis, self.reach, self.push = np.array([east, north]), reach, push

    def influence(self, scene: Scene, influence: Influence) -> Influence:
        """Return the influence with this method's force (N + 1, 3) added, m/s²."""
        away = self.axis - scene.prediction[:, :2]
        course = scene.to_go[:2] / (np.linalg.norm(scene.to_go[:2]) + 1e-9)
        near = np.clip(1.0 - np.linalg.norm(away, axis=1) / self.reach, 0.0, 1.0)
        ahead = away @ course > 0.0
        left = np.array([-course[1], course[0], 0.0])
        force = influence.force + (self.push * near * ahead)[:, None] * left
        return influence._replace(force=force)


def furthest_left(methods):
    """Return by how much (m) the way from west to east passes the line on the left."""
    planner = Planner(PlannerConfig(methods=("baseline",)), methods=methods)
    x, v, most, dt = np.array([-6.0, 0.0, 5.0]), np.zeros(3), 0.0, 0.02
    for turn in range(500):
        x, v, _ = planner.step(turn * dt, x, v, goal=(6.0, 0.0, 5.0)).plan.at((turn + 1) * dt)
        most = max(most, x[1])
    return most


print(f"without the method: {furthest_left([]):.2f} m to the left")
print(f"with it:            {furthest_left([KeepLeftOf(0.0, 0.0, 5.0, 10.0)]):.2f} m to the left")
