"""Companions on vehicles of ``outrider sitl`` or of simulations of real firmware, through what may happen to
them; no part of the wheel.

plan: what is asked → stage: vehicles, companions, hub, target, observer and station, turned in one loop →
mishaps or sortie: what happens, act by act → separation, score and verdict: what came of it.
"""
