"""Fields of those messages in ``messages.missions`` that are not in wire order."""

from __future__ import annotations

from mavlink_bridge import messages as m
from mavlink_bridge.wire.fields.units import Fields


def item(s: m.Source, f: Fields) -> m.MissionItem:
    """Decode MISSION_ITEM_INT."""
    return m.MissionItem(s, f[:4], *f[4:])


def item_fields(x: m.MissionItem | m.MissionItemFloat) -> Fields:
    """Encode MISSION_ITEM and MISSION_ITEM_INT."""
    return *x.params, *x[2:]


def item_float(s: m.Source, f: Fields) -> m.MissionItemFloat:
    """Decode MISSION_ITEM."""
    return m.MissionItemFloat(s, f[:4], *f[4:])
