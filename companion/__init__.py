"""Companion computer: takes MAVLink messages and the time, gives set-points, plans and status messages."""
