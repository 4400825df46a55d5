"""What is in a tlog, whoever recorded it:

    log → census (who speaks, what, with which breaks; what could not be read) → listing (tables, or JSON)

Only headers are read, and the last HEARTBEAT of each component.
"""
