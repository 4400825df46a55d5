"""Trials of companions: take a plan, fly its story on vehicles, give a verdict; no part of the wheel.

The vehicles are those of ``outrider sitl`` or of simulations of real firmware. ``plan`` is the request.
``stage`` holds vehicles, companions, their ports, target, observer and station, and steps them in one loop.
``mishaps`` and ``sortie`` are the stories, act by act. ``separation``, ``score`` and ``verdict`` evaluate the
flight.
"""
