"""Command ``outrider fly``: takes options and endpoints, flies one companion, gives logs and a summary.

``request`` checks the options. ``wiring`` opens the links. ``identify`` waits for the autopilot's heartbeat.
``child_process`` forks the worker that flies. ``flight`` gives orders, receives status and sends the hold
request at the end. ``screen`` or lines of text, events and a summary show the flight. The parent runs on the
wall clock; the companion may follow the autopilot's clock.
"""
