"""MAVLink component id of the companion."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

COMPONENT: Final[int] = mavlink.MAV_COMP_ID_PATHPLANNER
