"""Logs that drive a companion again.

run directory → runs → reenactment   a flight of ours: the same bytes out?
any tlog → casting → rehearsal       a flight of others: what would ours have sent?
any tlog → chase                     a vehicle of ours escorts what was recorded
any tlog → telemetry                 what vehicles said of themselves, onto a live link
"""
