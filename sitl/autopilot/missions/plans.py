"""The plans that a vehicle holds: a mission, a fence, rally points."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from struct import Struct
from typing import Final

from sitl.autopilot.missions.items import ACCEPTED, Item, Type, fault, whole_fault

_ITEM: Final = Struct("<BHB4fiif")


class Plans:
    """By type, the items of each. ``changed`` is called when the mission is another."""

    def __init__(self, saved: tuple[tuple[Item, ...], ...]) -> None:
        """``saved``: the items of mission, fence and rally points; what would be refused is left out."""
        self.changed: Callable[[], None] = lambda: None
        self._items: dict[Type, tuple[Item, ...]] = dict.fromkeys(Type, ())
        self._identities: dict[Type, int] = {}
        for of, items in zip(Type, saved, strict=False):
            sound = all(fault(item, of) == ACCEPTED for item in items)
            if sound and whole_fault(items, of) == ACCEPTED:
                self._items[of] = items

    def items(self, of: Type) -> tuple[Item, ...]:
        """The items of one plan."""
        return self._items[of]

    def replace(self, of: Type, items: tuple[Item, ...]) -> None:
        """Another plan from now on."""
        self._items[of] = items
        self._identities.pop(of, None)
        if of is Type.MISSION:
            self.changed()

    def identity(self, of: Type) -> int:
        """The opaque id of one plan: the same for the same items, 0 for none."""
        # Worked out once, as it goes out with every acknowledgement.
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
        """What there is to save."""
        return tuple(self._items[of] for of in Type)
