"""``outrider paper``: the paper's table and figures, flown again.

rows → cells → worker processes (``flying``) → results → table, Markdown, figures
"""
