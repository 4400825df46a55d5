"""Whole flights from Python: takes a scenario and changes, gives a flight with arrays, report and table.

The public names are in ``outrider``: ``outrider.fly``, ``outrider.Flight``.
"""
