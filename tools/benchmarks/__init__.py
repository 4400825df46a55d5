"""Benchmarks: other planners on the project's scenes, and real firmware beside the emulation.

They are not part of the wheel.

::

    scenes → flights of double integrators, steered by a peer → outcomes per scene and setting → table
    logs of real firmware → the same messages to the emulated autopilot → distance from the real one → table
"""
