"""Scenes of published planners, flown with their limits and measured with their measures.

::

    comparison → cells → worker processes (flying → measures) → results → table, Markdown, picture
"""
