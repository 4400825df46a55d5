"""The autopilots that we know."""

from __future__ import annotations

from companion.flight.autopilots import Profile
from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.flight.autopilots.px4 import PX4
from mavlink_bridge.messages import Heartbeat

KNOWN = {profile.autopilot: profile for profile in (ARDUPILOT, PX4)}
"""By MAV_AUTOPILOT."""


def profile_of(heartbeat: Heartbeat) -> Profile | None:
    """What the sender of ``heartbeat`` wants; None for one that is not known."""
    return KNOWN.get(heartbeat.autopilot)
