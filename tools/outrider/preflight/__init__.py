"""Check of a fleet before a certified flight, by one process on each companion.

    bytes → node (wait, measure, exchange) → autopilot, links, clock → reports → judgement → fleet file

Each process measures its own vehicle and what it receives of the others, and tells the others; so each has
all figures, and all write the same fleet file.
"""
