"""Logs that drive a companion again.

run directory → runs → reenactment   a flight of ours: the same bytes out?
any tlog → casting → rehearsal       a flight of others: what would ours have sent?
"""
