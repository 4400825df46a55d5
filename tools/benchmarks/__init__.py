"""Other planners on the scenes that ours flies, and real firmware beside our emulation; no part of the wheel.

scenes → flights of double integrators, steered by a peer → outcomes per scene and setting → table
logs of real firmware → the same messages to our autopilot → how far it is from where the real one was → table
"""
