"""MAVLink component ids of a vehicle's computers."""

from __future__ import annotations

COMPONENT = 195
"""MAV_COMP_ID_PATHPLANNER."""


AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1; the vehicle's position is accepted from no other of its components."""
