"""The Gymnasium vector environment: 256 vehicles, each beside a walking target, flown by a policy by hand."""

import numpy as np

from outrider.sim import EscortVectorEnv

env = EscortVectorEnv(256, radius=5.0)
seen, _ = env.reset(seed=1)
total = np.zeros(256)
for _ in range(400):
    offset, drift = seen[:, 0:3], seen[:, 3:6]
    distance = np.linalg.norm(offset, axis=1, keepdims=True)
    actions = (1.5 * offset * (1.0 - 5.0 / distance) + 2.0 * drift) / 5.0
    seen, rewards, terminated, truncated, _ = env.step(actions)
    total += rewards
print(f"mean reward of a step: {total.mean() / 400:.3f}; episodes that ended early: {terminated.sum()}")
