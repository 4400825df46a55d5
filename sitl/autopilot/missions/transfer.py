"""The mission protocol: plans up and down, one item at a time, whichever of the old and the new messages a
client speaks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

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
    ABOVE_HOME,
    ABOVE_SEA,
    ACCEPTED,
    ALL,
    CANCELLED,
    DENIED,
    ERROR,
    INVALID_PARAM,
    INVALID_SEQUENCE,
    NO_SPACE,
    UNSUPPORTED,
    Item,
    Type,
    fault,
    whole_fault,
)
from sitl.autopilot.missions.plans import Plans
from sitl.telemetry.status_text import Voice

CAPACITY: Final = 724
"""Items of a plan; ArduCopter's mission has room for as many."""
# An item that does not come is asked for again after so long (µs), and at most so often.
_PATIENCE, _TRIES = 500_000, 10
_NEVER: Final = 1 << 62
_KNOWN: Final = frozenset(int(of) for of in Type)


@dataclass
class _Upload:
    """``items`` that have come of ``total``; the first of them is number ``first`` of the plan."""

    partner: Source
    of: Type
    first: int
    total: int
    items: list[Item]
    partial: bool = False
    tries: int = 0


class Transfer:
    """Receives plans and gives them. A plan counts when its last item has come and all are good; what is
    broken off leaves the old one. ``next_due`` (µs): before it there is no ``work``.

    As ArduPilot, items are asked for with MISSION_REQUEST (40), and any form of item is an answer; as PX4,
    with MISSION_REQUEST_INT (51).
    """

    def __init__(
        self, source: Source, plans: Plans, outbox: list[Message], voice: Voice, *, asks_int: bool
    ) -> None:
        self._source = source
        self._plans = plans
        self._outbox = outbox
        self._voice = voice
        self._asks_int = asks_int
        self._upload: _Upload | None = None
        self.next_due = _NEVER

    # Up

    def count(self, message: MissionCount, now: int) -> None:
        """MISSION_COUNT (44): someone begins to send a plan."""
        of = self._known(message.source, message.mission_type)
        if of is None or self._is_busy(message.source, of):
            return
        if message.total > CAPACITY:
            self._acknowledge(message.source, of, NO_SPACE)
            return
        self._begin(_Upload(message.source, of, 0, message.total, []), now)

    def write_partial(self, message: MissionWritePartialList, now: int) -> None:
        """MISSION_WRITE_PARTIAL_LIST (38), which PX4 does not have: a part of a plan comes anew."""
        of = self._known(message.source, message.mission_type)
        if of is None or self._is_busy(message.source, of):
            return
        if self._asks_int:
            self._acknowledge(message.source, of, UNSUPPORTED)
        elif not 0 <= message.start <= message.end < len(self._plans.items(of)):
            self._acknowledge(message.source, of, ERROR)
        else:
            total = message.end - message.start + 1
            self._begin(_Upload(message.source, of, message.start, total, [], partial=True), now)

    def item(self, message: MissionItem | MissionItemFloat, now: int) -> None:
        """MISSION_ITEM_INT (73) or MISSION_ITEM (39): one that was asked for, or one that came twice."""
        upload = self._upload
        if upload is None or (message.source, message.mission_type) != (upload.partner, upload.of):
            self._acknowledge(message.source, message.mission_type, DENIED)
            return
        if message.seq != upload.first + len(upload.items):
            return
        item = _integer(message)
        result = INVALID_PARAM[4] if item is None else fault(item, upload.of)
        if item is None or result != ACCEPTED:
            self._end(result)
            return
        upload.items.append(item)
        upload.tries = 0
        if len(upload.items) < upload.total:
            self._ask(now)
        else:
            self._finish()

    def acknowledged(self, message: MissionAck, _now: int) -> None:
        """MISSION_ACK (47): the end of a download, or who sends a plan breaks off."""
        upload = self._upload
        is_mine = upload and (message.source, message.mission_type) == (upload.partner, upload.of)
        if is_mine and message.result != ACCEPTED:
            self._upload, self.next_due = None, _NEVER

    def clear(self, message: MissionClearAll, _now: int) -> None:
        """MISSION_CLEAR_ALL (45)."""
        if message.mission_type == ALL:
            for each in Type:
                self._plans.replace(each, ())
            self._acknowledge(message.source, ALL, ACCEPTED)
            return
        of = self._known(message.source, message.mission_type)
        if of is not None:
            self._plans.replace(of, ())
            self._acknowledge(message.source, of, ACCEPTED)

    def work(self, now: int) -> None:
        """Ask again, or give up."""
        upload = self._upload
        if upload is None:
            self.next_due = _NEVER
        elif upload.tries >= _TRIES:
            self._voice.warn("Mission upload timed out")
            self._end(CANCELLED)
        else:
            self._ask(now)

    # Down

    def list(self, message: MissionRequestList, _now: int) -> None:
        """MISSION_REQUEST_LIST (43)."""
        of = self._known(message.source, message.mission_type)
        if of is not None:
            total, identity = len(self._plans.items(of)), self._plans.identity(of)
            self._outbox.append(MissionCount(self._source, total, *message.source, of, identity))

    def request(self, message: MissionRequest | MissionRequestFloat, current: int) -> None:
        """MISSION_REQUEST_INT (51) or MISSION_REQUEST (40); ``current`` is the item that is flown."""
        of = self._known(message.source, message.mission_type)
        if of is None:
            return
        items = self._plans.items(of)
        if message.seq >= len(items):
            self._acknowledge(message.source, of, INVALID_SEQUENCE)
            return
        item, seq = items[message.seq], message.seq
        now_flown = int(of is Type.MISSION and seq == current)
        tail = (item.z, seq, item.command, *message.source, item.frame, now_flown, item.autocontinue, of)
        if isinstance(message, MissionRequest):
            self._outbox.append(MissionItem(self._source, item.params, item.x, item.y, *tail))
        else:
            x, y = _degrees(item)
            self._outbox.append(MissionItemFloat(self._source, item.params, x, y, *tail))

    # Within

    def _known(self, partner: Source, mission_type: int) -> Type | None:
        if mission_type in _KNOWN:
            return Type(mission_type)
        self._acknowledge(partner, mission_type, UNSUPPORTED)
        return None

    def _is_busy(self, partner: Source, of: Type) -> bool:
        if self._upload is None or self._upload.partner == partner:
            return False
        self._acknowledge(partner, of, DENIED)
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
        self.next_due = now + _PATIENCE
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
        if result == ACCEPTED:
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
    """With whole degE7; None where there is no such place."""
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
