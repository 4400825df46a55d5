"""Header filters of a companion's links, applied to each frame before anything is decoded."""

from __future__ import annotations

from collections.abc import Callable

from pymavlink.dialects.v20 import all as mavlink

from companion.config import CompanionConfig
from companion.config.target_source import (
    DETECTIONS,
    GIMBAL,
    CameraSource,
    FusedSource,
    message_of,
    sender_of,
)

_POSITION_AND_PLAN = {mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, mavlink.MAVLINK_MSG_ID_TUNNEL}
"""Messages with a neighbour's position and plan; dropped while the relevance filter ignores their sender."""
_ACCEPTED_IDS = {
    "autopilot": {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
        mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
    },
    "swarm": {
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
        mavlink.MAVLINK_MSG_ID_TUNNEL,
    },
    "ground": {mavlink.MAVLINK_MSG_ID_COMMAND_INT, mavlink.MAVLINK_MSG_ID_COMMAND_LONG},
}
LINKS = ("autopilot", "swarm", "target", "ground")
"""The links of a companion."""


def accepts(
    link: str,
    system: int,
    target: int,
    config: CompanionConfig,
    ignores: Callable[[int, int], bool] = lambda _sender, _component: False,
) -> Callable[[int, int, int], bool]:
    """Return the header filter of ``link`` for the companion of ``system``.

    The filter takes message id, sender and component, and returns whether this link accepts the message from
    this sender. ``target`` is the system id of the target. ``ignores`` takes sender and component of a
    message on the swarm link and returns whether positions and plans of this sender are to be dropped. The
    filter of an unknown link accepts nothing.
    """
    wanted = _ACCEPTED_IDS.get(link, set())
    if link == "autopilot" and config.limits_from_autopilot:
        wanted = wanted | {mavlink.MAVLINK_MSG_ID_PARAM_VALUE}
    if link == "autopilot" and config.certified.fleet_time == "measured":
        wanted = wanted | {mavlink.MAVLINK_MSG_ID_SYSTEM_TIME}
    source = config.target_source
    distances = {mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE} if config.proximity is not None else set()
    traffic = {mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE} if config.traffic is not None else set()
    # Sensors of the own system may send on the autopilot link and on the swarm link.
    sensors = distances | traffic
    detections = DETECTIONS if isinstance(source, FusedSource) else frozenset[int]()
    reported, target_sender = message_of(source), sender_of(source, system, target)
    if link == "autopilot":
        camera = reported if isinstance(source, CameraSource) else None
        if isinstance(source, FusedSource) and source.optics is not None:
            detections |= {GIMBAL}
        return lambda identifier, sender, component: (
            (identifier in wanted and sender == system and component == mavlink.MAV_COMP_ID_AUTOPILOT1)
            or (identifier in sensors and sender == system)
            or (identifier in detections and sender == system)
            or (identifier == camera and sender == target_sender)
        )
    if link == "target":
        return lambda identifier, sender, _component: (
            identifier == reported and (target_sender is None or sender == target_sender)
        )
    if link == "swarm":
        # ADSB_VEHICLE may come from any sender on the swarm link, not only from the own system.
        wanted = wanted | traffic | detections
        return lambda identifier, sender, component: (
            identifier in sensors
            if sender == system
            else identifier in wanted
            and not (identifier in _POSITION_AND_PLAN and ignores(sender, component))
        )
    return lambda identifier, _sender, _component: identifier in wanted
