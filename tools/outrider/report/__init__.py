"""Report of a run directory as one self-contained HTML page.

::

    directory → reading → run (motions, plans, logs) → charts, events, loss, scene → page

The page lists missing or damaged files and shows the rest. The page's scripts and styles are in ``static/``:
they only draw; this package computes all figures.
"""
