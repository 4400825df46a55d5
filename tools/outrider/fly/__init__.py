"""``outrider fly``: one companion on an autopilot, under the wall clock.

request: options, checked → wiring opens the links → identify hears the autopilot → crew forks the worker that
flies → flight gives orders, hears how it is, and has the last word → screen or lines, events, summary.
"""
