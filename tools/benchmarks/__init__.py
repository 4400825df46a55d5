"""Other planners on the scenes that ours flies, to be measured beside it; no part of the wheel.

scenes → flights of double integrators, steered by a peer → outcomes per scene and setting → table
"""
