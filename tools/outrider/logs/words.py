"""MAVLink's names for the numbers of a census."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import BY_ID
from outrider.logs.census import Vehicle

MILLION: Final = 1_000_000
"""µs of a second."""


def rates(vehicle: Vehicle) -> Mapping[str, float]:
    """Return the messages per second by name, the most frequent first."""
    return {_message(number): vehicle.rate(many) for number, many in vehicle.counts}


def _message(number: int) -> str:
    """Return the name of a message of the dialect, or of one that it lacks and the bridge has."""
    known = mavlink.mavlink_map.get(number)
    return BY_ID[number].name if known is None else str(known.msgname)


def enumerated(enumeration: str, number: int | None) -> str | None:
    """Return the name of ``number`` in ``enumeration``; None for None.

    Without a name, it is the enumeration's name and the number.
    """
    if number is None:
        return None
    entry = mavlink.enums[enumeration].get(number)
    return f"{enumeration}_{number}" if entry is None else str(entry.name)


def kind(vehicle: Vehicle) -> str:
    """Return type and autopilot in words."""
    autopilot = None if vehicle.autopilot == mavlink.MAV_AUTOPILOT_INVALID else vehicle.autopilot
    named = (("MAV_TYPE", vehicle.kind), ("MAV_AUTOPILOT", autopilot))
    names = [(enumeration, enumerated(enumeration, number)) for enumeration, number in named]
    words = [name.removeprefix(f"{before}_").lower().replace("_", " ") for before, name in names if name]
    return ", ".join(words) or "no heartbeat"
