"""Certification of a run: takes a run directory, gives a verdict from the transmitted plans and rosters.

The steps are directory → ``reading`` → ``evidence`` → ``histories`` (each vehicle's plans) → ``pairs`` (of
one epoch) → ``verdict``. The package uses no code that makes plans.
"""
