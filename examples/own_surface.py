"""A formation surface of your own: two lines beside a walking target, seen from above."""

import numpy as np

from outrider import Neighbour, Planner, PlannerConfig, Target


class TwoLines:
    """Lines along north, 4 m east and west of the target, 5 m above it, 6 m long."""

    def nearest(self, offset):
        """Return the point (3,) of the surface nearest to ``offset`` (3,) from the target, m."""
        side = 4.0 if offset[0] >= 0.0 else -4.0
        return side, np.clip(offset[1], -3.0, 3.0), 5.0


config = PlannerConfig(
    field={"d_min": 1.0, "d_safe": 2.5}, limits={"box_min": (-50, -50, 2), "box_max": (50, 50, 10)}
)
x = np.array([[6.0, 2.0, 5.0], [6.0, -2.0, 5.0], [-6.0, 0.0, 5.0]])
v, plans, dt = np.zeros_like(x), [None] * 3, 0.05
planners = [Planner(config, id=k + 1, surface=TwoLines()) for k in range(3)]

for turn in range(400):
    now = turn * dt
    target = Target(position=(0.5 * now, 1.0 * now, 0.0), velocity=(0.5, 1.0, 0.0))
    steps = []
    for k, planner in enumerate(planners):
        others = [Neighbour(j + 1, x[j], v[j], plans[j]) for j in range(3) if j != k]
        steps.append(planner.step(now, x[k], v[k], target=target, neighbours=others))
    plans = [step.plan for step in steps]
    for k, plan in enumerate(plans):
        x[k], v[k], _ = plan.at(now + dt)

offsets = x - target.position - dt * np.asarray(target.velocity)
print("offsets from the target after 20 s, m:\n", offsets.round(1))
