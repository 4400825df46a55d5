"""Flight of a scenario in real time: takes a scenario, gives its outcome, with one process per node over UDP.

wiring opens the links → fleet makes the nodes → workers fork and run them, each under its own loop → the
shared page holds the state that the parent observes → flight conducts, ends, and merges the true traces.
"""
