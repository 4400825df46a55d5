"""Sweeps: flies many runs of many scenarios from a sweep file and returns a table, JSON and a picture.

::

    sweep file → cells (grid, cells; random ones by scenes, draw) → tasks → pool of worker processes
               → journal → report with statistics → table, JSON, picture

A sweep is seeded and resumable. Everything that can be checked in advance is checked before the first flight.
Every flown run is in the journal before it counts.
"""
