"""Replay: takes logs, drives companions or links with them, and gives a comparison or set-points.

- Run directory: ``run_replay``, ``companion_replay``. Does each companion send the same bytes again?
- Any tlog, ``--own``: ``outrider.shadow``. What would an own companion have sent?
- Any tlog, ``--target``: ``target_replay``. An own vehicle escorts the recorded target.
- Any tlog, ``--to``: ``telemetry``. Recorded telemetry is sent to a live link.
"""
