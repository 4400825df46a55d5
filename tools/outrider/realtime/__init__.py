"""A scenario in real time: one process per node, over UDP on this machine, led and watched by the parent.

wiring opens the links → fleet makes the nodes → workers fork and run them, each under its own loop → the
board shares what the parent must see → flight conducts, ends, and puts the true traces together.
"""
