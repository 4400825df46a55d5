"""Telemetry: it takes snapshots of an autopilot and gives the MAVLink messages that are due."""
