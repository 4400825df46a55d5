"""Contents of a tlog from any recorder: takes a log, gives its systems, messages, rates and gaps.

    log → census (systems, their messages and gaps; unreadable parts) → listing (tables, or JSON)

For the census only headers are read, and the last HEARTBEAT of each component. ``message_stream`` and
``dialect`` give all messages to other packages.
"""
