"""A whole flight from Python: the physics, the autopilots, the links and the companions of a scenario."""

import outrider

flight = outrider.fly("antipodal-8", seed=3, vehicles=4, sensors="rtk", companion={"methods": ["tangential"]})
print(flight)
print(f"converged after {flight.summary['convergence_time_s']} s")
speeds = (flight.velocities**2).sum(axis=-1) ** 0.5  # (T, K), m/s
print(f"fastest: {speeds.max():.1f} m/s; nearest to each other: {flight.separation.min():.2f} m")
print(flight.to_pandas().groupby("system").up_m.max())
print(f"report: {len(flight.to_html().read_bytes()) // 1024} KiB")
