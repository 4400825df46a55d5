"""Command ``outrider swarm``: takes a prepared scenario and a seed, gives a run directory."""
