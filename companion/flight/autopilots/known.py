"""Registry of the supported autopilots."""

from __future__ import annotations

from companion.flight.autopilots import Profile
from companion.flight.autopilots.ardupilot import ARDUPILOT
from companion.flight.autopilots.px4 import PX4
from mavlink_bridge.messages import Heartbeat

KNOWN = {profile.autopilot: profile for profile in (ARDUPILOT, PX4)}
"""Profiles by MAV_AUTOPILOT."""


def profile_of(heartbeat: Heartbeat) -> Profile | None:
    """Return the profile for the sender of ``heartbeat``; None for an unknown autopilot."""
    return KNOWN.get(heartbeat.autopilot)
