"""Planner of one vehicle in a loop: takes states as arrays, gives a plan and a set-point.

The public names are in ``outrider`` (``outrider.Planner``, …). A step is the companion's own: ``planner`` →
``surroundings`` (the world picture, from arrays in place of messages) → ``companion.planning`` (field or
committed plans) → ``values``.
"""
