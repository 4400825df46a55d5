"""``outrider sitl``: emulated vehicles under the wall clock, for other people's tools to connect to.

command → request: options, checked → addresses: endpoints of the firmware's own SITL → wiring opens them →
crew forks squads, each some vehicles as one node under one loop → board shows → screen.
"""
