"""Sweeps: flies many runs of many scenarios from a sweep file, resumable, and returns table, JSON and picture.

::

    sweep file → cells (grid, cells; random ones by scenes, draw) → tasks → pool of worker processes
               → journal → report with statistics → table, JSON, picture

All inputs are checked before the first flight. Every flown run is in the journal before it counts.
"""
