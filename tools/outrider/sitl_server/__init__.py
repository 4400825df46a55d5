"""Command ``outrider sitl``: takes options, runs emulated vehicles for external tools to connect to.

``request`` checks the options, ``addresses`` gives the endpoints of the firmware's own SITL, ``command``
opens them. ``processes`` forks one worker per group of vehicles; each group is one node under one loop.
``shared_page`` passes the state to ``screen`` and ``event_feed``. The wall clock paces the simulated time.
"""
