"""Plans that a vehicle stores: a mission, a fence, rally points."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from struct import Struct
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from sitl.autopilot.missions.items import Item, Type, fault, whole_fault

_ITEM: Final = Struct("<BHB4fiif")


class Plans:
    """Items of each plan, by type. ``changed`` is called when the mission is replaced."""

    def __init__(self, saved: tuple[tuple[Item, ...], ...]) -> None:
        """``saved``: the items of mission, fence and rally points; invalid plans are dropped."""
        self.changed: Callable[[], None] = lambda: None
        self._items: dict[Type, tuple[Item, ...]] = dict.fromkeys(Type, ())
        self._identities: dict[Type, int] = {}
        for of, items in zip(Type, saved, strict=False):
            sound = all(fault(item, of) == mavlink.MAV_MISSION_ACCEPTED for item in items)
            if sound and whole_fault(items, of) == mavlink.MAV_MISSION_ACCEPTED:
                self._items[of] = items

    def items(self, of: Type) -> tuple[Item, ...]:
        """Return the items of one plan."""
        return self._items[of]

    def replace(self, of: Type, items: tuple[Item, ...]) -> None:
        """Replace a plan."""
        self._items[of] = items
        self._identities.pop(of, None)
        if of is Type.MISSION:
            self.changed()

    def identity(self, of: Type) -> int:
        """Return the opaque id of one plan: equal for equal items, 0 for none."""
        # Cached, because every acknowledgement contains it.
        if of not in self._identities:
            self._identities[of] = self._summed(of)
        return self._identities[of]

    def _summed(self, of: Type) -> int:
        items = self._items[of]
        if not items:
            return 0
        data = b"".join(
            _ITEM.pack(i.frame, i.command, i.autocontinue, *i.params, i.x, i.y, i.z) for i in items
        )
        return zlib.crc32(data, of) or 1

    @property
    def all(self) -> tuple[tuple[Item, ...], ...]:
        """All plans, in the order of ``Type``, for saving."""
        return tuple(self._items[of] for of in Type)
