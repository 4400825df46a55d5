"""Mission protocol: upload and download of plans, item by item, with coordinates as floats or integers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import (
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItem,
    MissionItemFloat,
    MissionRequest,
    MissionRequestFloat,
    MissionRequestList,
    MissionWritePartialList,
    Source,
)
from sitl.autopilot.missions.items import (
    Item,
    Type,
    fault,
    whole_fault,
)
from sitl.autopilot.missions.plans import Plans
from sitl.telemetry.status_text import StatusReporter
from sitl.values.home import ABOVE_HOME, ABOVE_SEA

CAPACITY: Final = 724
"""Greatest number of items of a plan, the capacity of ArduCopter's mission."""
# Time after which a missing item is requested again (µs), and the limit of requests.
_RETRY_US, _MAX_TRIES = 500_000, 10
_NEVER: Final = 1 << 62
_GUIDED, _ALTITUDE = 2, 3
"""Values of ``current`` of ArduPilot's items that are no items of a plan."""
_KNOWN: Final = frozenset(int(of) for of in Type)


@dataclass
class _Upload:
    """Upload in progress: ``items`` received of ``total``; the first is number ``first`` of the plan."""

    partner: Source
    of: Type
    first: int
    total: int
    items: list[Item]
    partial: bool = False
    tries: int = 0


class Transfer:
    """Receiver and sender of plans.

    A plan takes effect when its last item has arrived and all are valid; an aborted upload leaves the old
    plan. ``next_due`` (µs): no ``work`` is due before it. ArduPilot requests items with MISSION_REQUEST (40),
    PX4 with MISSION_REQUEST_INT (51); MISSION_ITEM_INT (73) or MISSION_ITEM (39) answers either request.

    ArduPilot's item 0 is home: it is sent as home whatever was uploaded, even where there is no mission.
    An item with ``current`` 2 is no item of a plan but a place to fly to in GUIDED; ``current`` 3 has no
    effect on an ArduCopter, and is accepted.
    """

    def __init__(
        self,
        source: Source,
        plans: Plans,
        outbox: list[Message],
        status_text: StatusReporter,
        *,
        asks_int: bool,
        home: Callable[[], Item] | None = None,
        guided: Callable[[Item, int], bool] | None = None,
    ) -> None:
        """Set the partners.

        ``home`` returns item 0 of a mission, None where it is an item like others. ``guided`` flies to a
        place at a time (µs) and returns whether it does; None where the firmware has no such items.
        """
        self._home, self._guided = home, guided
        self._source = source
        self._plans = plans
        self._outbox = outbox
        self._status_text = status_text
        self._asks_int = asks_int
        self._upload: _Upload | None = None
        self.next_due = _NEVER

    # Upload

    def count(self, message: MissionCount, now: int) -> None:
        """Handle MISSION_COUNT (44), the start of an upload."""
        of = self._known(message.source, message.mission_type)
        if of is None or self._is_busy(message.source, of):
            return
        if message.total > CAPACITY:
            self._acknowledge(message.source, of, mavlink.MAV_MISSION_NO_SPACE)
            return
        self._begin(_Upload(message.source, of, 0, message.total, []), now)

    def write_partial(self, message: MissionWritePartialList, now: int) -> None:
        """Handle MISSION_WRITE_PARTIAL_LIST (38), the upload of a part of a plan; not supported by PX4."""
        of = self._known(message.source, message.mission_type)
        if of is None or self._is_busy(message.source, of):
            return
        if self._asks_int:
            self._acknowledge(message.source, of, mavlink.MAV_MISSION_UNSUPPORTED)
        elif not 0 <= message.start <= message.end < len(self._plans.items(of)):
            self._acknowledge(message.source, of, mavlink.MAV_MISSION_ERROR)
        else:
            total = message.end - message.start + 1
            self._begin(_Upload(message.source, of, message.start, total, [], partial=True), now)

    def item(self, message: MissionItem | MissionItemFloat, now: int) -> None:
        """Handle MISSION_ITEM_INT (73) or MISSION_ITEM (39): the requested item or a repeated one."""
        if self._guided is not None and message.current in (_GUIDED, _ALTITUDE):
            item, flies = _integer(message), message.current == _ALTITUDE
            if item is not None and not flies:
                flies = self._guided(item, now)
            result = mavlink.MAV_MISSION_ACCEPTED if flies else mavlink.MAV_MISSION_ERROR
            self._acknowledge(message.source, Type.MISSION, result)
            return
        upload = self._upload
        if upload is None or (message.source, message.mission_type) != (upload.partner, upload.of):
            self._acknowledge(message.source, message.mission_type, mavlink.MAV_MISSION_DENIED)
            return
        if message.seq != upload.first + len(upload.items):
            return
        item = _integer(message)
        result = mavlink.MAV_MISSION_INVALID_PARAM5_X if item is None else fault(item, upload.of)
        if item is None or result != mavlink.MAV_MISSION_ACCEPTED:
            self._end(result)
            return
        upload.items.append(item)
        upload.tries = 0
        if len(upload.items) < upload.total:
            self._ask(now)
        else:
            self._finish()

    def acknowledged(self, message: MissionAck, _now: int) -> None:
        """Handle MISSION_ACK (47): the end of a download, or the abort of an upload by its sender."""
        upload = self._upload
        is_mine = upload and (message.source, message.mission_type) == (upload.partner, upload.of)
        if is_mine and message.result != mavlink.MAV_MISSION_ACCEPTED:
            self._upload, self.next_due = None, _NEVER

    def clear(self, message: MissionClearAll, _now: int) -> None:
        """Handle MISSION_CLEAR_ALL (45)."""
        if message.mission_type == mavlink.MAV_MISSION_TYPE_ALL:
            for each in Type:
                self._plans.replace(each, ())
            self._acknowledge(message.source, mavlink.MAV_MISSION_TYPE_ALL, mavlink.MAV_MISSION_ACCEPTED)
            return
        of = self._known(message.source, message.mission_type)
        if of is not None:
            self._plans.replace(of, ())
            self._acknowledge(message.source, of, mavlink.MAV_MISSION_ACCEPTED)

    def work(self, now: int) -> None:
        """Request the missing item again, or give up."""
        upload = self._upload
        if upload is None:
            self.next_due = _NEVER
        elif upload.tries >= _MAX_TRIES:
            self._status_text.warn("Mission upload timed out")
            self._end(mavlink.MAV_MISSION_OPERATION_CANCELLED)
        else:
            self._ask(now)

    # Download

    def list(self, message: MissionRequestList, _now: int) -> None:
        """Handle MISSION_REQUEST_LIST (43)."""
        of = self._known(message.source, message.mission_type)
        if of is not None:
            total, identity = len(self._plans.items(of)), self._plans.identity(of)
            self._outbox.append(MissionCount(self._source, total, *message.source, of, identity))

    def request(self, message: MissionRequest | MissionRequestFloat, current: int) -> None:
        """Handle MISSION_REQUEST_INT (51) or MISSION_REQUEST (40); ``current`` is the item that is flown."""
        of = self._known(message.source, message.mission_type)
        if of is None:
            return
        items = self._plans.items(of)
        if of is Type.MISSION and message.seq == 0 and self._home is not None:
            items = (self._home(), *items[1:])
        if message.seq >= len(items):
            self._acknowledge(message.source, of, mavlink.MAV_MISSION_INVALID_SEQUENCE)
            return
        item, seq = items[message.seq], message.seq
        now_flown = int(of is Type.MISSION and seq == current)
        tail = (item.z, seq, item.command, *message.source, item.frame, now_flown, item.autocontinue, of)
        if isinstance(message, MissionRequest):
            self._outbox.append(MissionItem(self._source, item.params, item.x, item.y, *tail))
        else:
            x, y = _degrees(item)
            self._outbox.append(MissionItemFloat(self._source, item.params, x, y, *tail))

    # Internals

    def _known(self, partner: Source, mission_type: int) -> Type | None:
        if mission_type in _KNOWN:
            return Type(mission_type)
        self._acknowledge(partner, mission_type, mavlink.MAV_MISSION_UNSUPPORTED)
        return None

    def _is_busy(self, partner: Source, of: Type) -> bool:
        if self._upload is None or self._upload.partner == partner:
            return False
        self._acknowledge(partner, of, mavlink.MAV_MISSION_DENIED)
        return True

    def _begin(self, upload: _Upload, now: int) -> None:
        self._upload = upload
        if upload.total:
            self._ask(now)
        else:
            self._finish()

    def _ask(self, now: int) -> None:
        upload = self._upload
        if upload is None:
            return
        upload.tries += 1
        self.next_due = now + _RETRY_US
        ask = MissionRequest if self._asks_int else MissionRequestFloat
        seq = upload.first + len(upload.items)
        self._outbox.append(ask(self._source, seq, *upload.partner, upload.of))

    def _finish(self) -> None:
        upload = self._upload
        if upload is None:
            return
        items = tuple(upload.items)
        if upload.partial:
            old = self._plans.items(upload.of)
            items = (*old[: upload.first], *items, *old[upload.first + len(items) :])
        result = whole_fault(items, upload.of)
        if result == mavlink.MAV_MISSION_ACCEPTED:
            self._plans.replace(upload.of, items)
        self._end(result)

    def _end(self, result: int) -> None:
        upload = self._upload
        self._upload, self.next_due = None, _NEVER
        if upload is not None:
            self._acknowledge(upload.partner, upload.of, result)

    def _acknowledge(self, partner: Source, of: int, result: int) -> None:
        identity = self._plans.identity(Type(of)) if of in _KNOWN else 0
        self._outbox.append(MissionAck(self._source, *partner, result, of, identity))


def _integer(message: MissionItem | MissionItemFloat) -> Item | None:
    """Return the item with integer coordinates; None if they do not fit.

    They are in degE7 in the frames of ``ABOVE_SEA`` and ``ABOVE_HOME``, and in 1e-4 m in all other frames.
    """
    x, y = message.x, message.y
    if isinstance(message, MissionItemFloat):
        scale = 1e7 if message.frame in ABOVE_SEA | ABOVE_HOME else 1e4
        if not (abs(x * scale) < 1 << 31 and abs(y * scale) < 1 << 31):
            return None
        x, y = round(x * scale), round(y * scale)
    frame, command, autocontinue = message.frame, message.command, message.autocontinue
    return Item(frame, command, autocontinue, message.params, int(x), int(y), message.z)


def _degrees(item: Item) -> tuple[float, float]:
    scale = 1e7 if item.frame in ABOVE_SEA | ABOVE_HOME else 1e4
    return item.x / scale, item.y / scale
