"""Parameters: a table for each firmware, the values of one vehicle, and the protocol that shows and
sets them.

table → values ⇄ settings of the autopilot; protocol: PARAM_* messages → values → PARAM_VALUE.
"""
