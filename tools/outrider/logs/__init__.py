"""Contents of a tlog from any recorder: takes a log, gives its systems, messages, rates and gaps.

    log → census (systems, their messages and gaps; unreadable parts) → listing (tables, or JSON)

Only headers are read, and the last HEARTBEAT of each component.
"""
