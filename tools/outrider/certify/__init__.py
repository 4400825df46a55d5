"""Certification of a run: takes a run directory, gives a verdict from the transmitted plans and statements.

The steps are directory → ``reading`` → ``evidence`` → ``histories`` (each vehicle's plans) → ``lists`` (of
agreements, from each vehicle's log) → ``agreed_planes`` (plans against agreements) and ``pairs`` (plans
against plans), ``fixed_obstacles`` (plans against ``solids``) → ``verdict``. The package uses no code that
makes plans or agreements.
"""
