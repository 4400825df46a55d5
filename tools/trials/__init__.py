"""Five companions on five vehicles of ``outrider sitl``, through all that may happen to them; no part of the
wheel.

plan: what is asked → stage: SITL, companions, hub, target, observer and station, turned in one loop → story:
what happens, act by act → separation and verdict: what came of it.
"""
