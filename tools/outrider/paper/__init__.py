"""Reproduction of the paper: flies the table's rows and returns the table, Markdown and figures.

::

    rows → cells → worker processes (flying) → results → table, Markdown, figures
"""
