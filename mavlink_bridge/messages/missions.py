"""Messages of the mission protocol: transfer of missions, fences and rally points in both directions.

``mission_type`` is MAV_MISSION_TYPE. ``opaque_id`` identifies the plan that the vehicle holds; 0 without a
plan.
"""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import Fields
from mavlink_bridge.messages.source import Source


@message("MISSION_WRITE_PARTIAL_LIST", size_v1=6)
class MissionWritePartialList(NamedTuple):
    """MISSION_WRITE_PARTIAL_LIST (38): items ``start`` to ``end``, both included, will be sent again."""

    source: Source
    start: int
    end: int
    target_system: int
    target_component: int
    mission_type: int


@message("MISSION_ITEM", size_v1=37)
class MissionItemFloat(NamedTuple):
    """MISSION_ITEM (39), the old form: ``x``, ``y`` in degrees or metres as float32."""

    source: Source
    params: tuple[float, float, float, float]
    x: float
    y: float
    z: float
    seq: int
    command: int
    target_system: int
    target_component: int
    frame: int
    current: int
    autocontinue: int
    mission_type: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> MissionItemFloat:
        return MissionItemFloat(source, fields[:4], *fields[4:])

    def encode(self) -> Fields:
        return *self.params, *self[2:]


@message("MISSION_REQUEST", size_v1=4)
class MissionRequestFloat(NamedTuple):
    """MISSION_REQUEST (40), the old form."""

    source: Source
    seq: int
    target_system: int
    target_component: int
    mission_type: int


@message("MISSION_SET_CURRENT")
class MissionSetCurrent(NamedTuple):
    """MISSION_SET_CURRENT (41)."""

    source: Source
    seq: int
    target_system: int
    target_component: int


@message("MISSION_CURRENT", size_v1=2, layout="<HHBBIII", more=("mission_id", "fence_id", "rally_points_id"))
class MissionCurrent(NamedTuple):
    """MISSION_CURRENT (42).

    ``total`` is the number of items without home (MAVLink: 65535 without a mission, 0 if not supported);
    ``state`` is MISSION_STATE; ``mode`` is 1 in mission mode, 2 out of it; the ids of the three plans follow.
    """

    source: Source
    seq: int
    total: int
    state: int
    mode: int
    mission_id: int
    fence_id: int
    rally_id: int


@message("MISSION_REQUEST_LIST", size_v1=2)
class MissionRequestList(NamedTuple):
    """MISSION_REQUEST_LIST (43)."""

    source: Source
    target_system: int
    target_component: int
    mission_type: int


@message("MISSION_COUNT", size_v1=4, layout="<HBBBI", more=("opaque_id",))
class MissionCount(NamedTuple):
    """MISSION_COUNT (44)."""

    source: Source
    total: int
    target_system: int
    target_component: int
    mission_type: int
    opaque_id: int


@message("MISSION_CLEAR_ALL", size_v1=2)
class MissionClearAll(NamedTuple):
    """MISSION_CLEAR_ALL (45)."""

    source: Source
    target_system: int
    target_component: int
    mission_type: int


@message("MISSION_ITEM_REACHED")
class MissionItemReached(NamedTuple):
    """MISSION_ITEM_REACHED (46)."""

    source: Source
    seq: int


@message("MISSION_ACK", size_v1=3, layout="<BBBBI", more=("opaque_id",))
class MissionAck(NamedTuple):
    """MISSION_ACK (47): ``result`` is MAV_MISSION_RESULT."""

    source: Source
    target_system: int
    target_component: int
    result: int
    mission_type: int
    opaque_id: int


@message("MISSION_REQUEST_INT", size_v1=4)
class MissionRequest(NamedTuple):
    """MISSION_REQUEST_INT (51)."""

    source: Source
    seq: int
    target_system: int
    target_component: int
    mission_type: int


@message("MISSION_ITEM_INT", size_v1=37)
class MissionItem(NamedTuple):
    """MISSION_ITEM_INT (73): ``x``, ``y`` are the raw int32 (degE7, or 0.1 mm in local frames)."""

    source: Source
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    seq: int
    command: int
    target_system: int
    target_component: int
    frame: int
    current: int
    autocontinue: int
    mission_type: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> MissionItem:
        return MissionItem(source, fields[:4], *fields[4:])

    def encode(self) -> Fields:
        return *self.params, *self[2:]
