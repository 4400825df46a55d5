"""Those of ``messages.missions`` that do not have their fields in wire order."""

from __future__ import annotations

from mavlink_bridge import messages as m
from mavlink_bridge.wire.fields.units import Fields


def item(s: m.Source, f: Fields) -> m.MissionItem:
    return m.MissionItem(s, f[:4], *f[4:])


def item_fields(x: m.MissionItem | m.MissionItemFloat) -> Fields:
    return *x.params, *x[2:]


def item_float(s: m.Source, f: Fields) -> m.MissionItemFloat:
    return m.MissionItemFloat(s, f[:4], *f[4:])
