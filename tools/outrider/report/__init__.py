"""A run directory as one HTML page that needs nothing but itself:

    directory → reading → run (motions, plans, logs) → charts, events, loss, scene → page

What is missing or damaged is named on the page; the rest of it stands. The page's own program and looks lie
in ``static/``: they draw, and work out nothing that could be worked out here.
"""
