"""The planner alone: four vehicles swap places, with arrays in and plans out."""

import numpy as np

from outrider import Neighbour, Planner, PlannerConfig

config = PlannerConfig(methods=("tangential",), turning_sense="right", field={"d_min": 1.0})
starts = np.array([[5.0, 0.0, 5.0], [0.0, 5.0, 5.0], [-5.0, 0.0, 5.0], [0.0, -5.0, 5.0]])
goals = starts * [-1, -1, 1]  # m: east, north, up
x, v = starts.copy(), np.zeros_like(starts)
planners = [Planner(config, id=k + 1) for k in range(len(x))]
plans = [None] * len(x)
least, now, dt = np.inf, 0.0, 0.02  # s

while np.linalg.norm(x - goals, axis=1).max() > 0.3 and now < 20.0:
    steps = [
        planner.step(
            now,
            x[k],
            v[k],
            goal=goals[k],
            neighbours=[Neighbour(j + 1, x[j], v[j], plans[j]) for j in range(len(x)) if j != k],
        )
        for k, planner in enumerate(planners)
    ]
    plans, now = [step.plan for step in steps], now + dt
    for k, plan in enumerate(plans):  # these vehicles follow their plans exactly; yours follow step.setpoint
        x[k], v[k], _ = plan.at(now)
    least = min(least, min(np.linalg.norm(x[j] - x[k]) for j in range(4) for k in range(j)))

print(f"swapped after {now:.1f} s, never nearer than {least:.2f} m")
