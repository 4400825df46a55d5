"""Committed plans: planners exchange packets, and every plan stays apart from all others' plans.

The packets are bytes (MAVLink frames): send them to all others in any way, also late or not at all.
"""

import numpy as np

from outrider import Planner, PlannerConfig

config = PlannerConfig(avoidance="certified", turning_sense="right", field={"d_min": 1.0})
angles = 2.0 * np.pi * np.arange(6) / 6
x = np.column_stack([6.0 * np.cos(angles), 6.0 * np.sin(angles), np.full(6, 5.0)])
goals, v = x * [-1, -1, 1], np.zeros_like(x)
planners = [Planner(config, id=k + 1) for k in range(len(x))]
sent = [()] * len(x)
random, least, now, dt = np.random.default_rng(1), np.inf, 0.0, 0.02

while np.linalg.norm(x - goals, axis=1).max() > 0.3 and now < 40.0:
    steps = []
    for k, planner in enumerate(planners):
        heard = [packet for j in range(len(x)) if j != k for packet in sent[j] if random.random() > 0.2]
        steps.append(planner.step(now, x[k], v[k], goal=goals[k], packets=heard))
    sent, now = [step.packets for step in steps], now + dt
    for k, step in enumerate(steps):
        if step.plan is not None:  # at first the vehicle rests for half a second
            x[k], v[k], _ = step.plan.at(now)
    least = min(least, min(np.linalg.norm(x[j] - x[k]) for j in range(6) for k in range(j)))

print(f"swapped after {now:.1f} s with a fifth of the packets lost, never nearer than {least:.2f} m")
