"""Parameters: a table for each firmware, the values of one vehicle, and the PARAM_* protocol.

The flow is table → values ⇄ settings of the autopilot; protocol: PARAM_* messages → values → PARAM_VALUE.
"""
