"""A thousand hexarotors in one batch fly circles of their own; how many physics steps a second?"""

import time

import numpy as np

from outrider import sim

batch = sim.Batch("firefly", 1000)
centres = batch.positions
radius, rate = 2.0, np.random.default_rng(1).uniform(0.3, 0.8, 1000)  # m, rad/s
steps = 8  # physics steps of batch.dt = 2.5 ms for each command
commands = np.zeros((1000, 9))  # position, velocity, acceleration; ENU

batch.step(commands[:, 0:3] + centres, 1)  # the compiled physics is loaded by the first step
started = time.process_time()
for turn in range(200):
    phase = rate * turn * steps * batch.dt
    ring = np.column_stack([np.cos(phase), np.sin(phase), np.zeros(1000)])
    across = np.column_stack([-np.sin(phase), np.cos(phase), np.zeros(1000)])
    commands[:, 0:3] = centres + radius * (ring - [1.0, 0.0, 0.0])
    commands[:, 3:6] = radius * rate[:, None] * across
    commands[:, 6:9] = -radius * rate[:, None] ** 2 * ring
    batch.step(commands, steps, wind=(2.0, 0.0, 0.0))
spent = time.process_time() - started

error = np.linalg.norm(batch.positions - commands[:, 0:3] - steps * batch.dt * commands[:, 3:6], axis=1)
print(f"{1000 * 200 * steps / spent / 1e6:.1f} million vehicle-steps a second of CPU time")
print(f"median distance from the circle: {100 * np.median(error):.0f} cm")
