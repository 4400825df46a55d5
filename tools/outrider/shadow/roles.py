"""Assignment of a log's systems to roles: own vehicle, neighbours, target; and the use of each record."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.values.components import COMPONENT
from mavlink_bridge.frames import FleetFrame
from mavlink_bridge.messages import GlobalPosition, GpsGlobalOrigin, LocalPosition, Source
from mavlink_bridge.tlog.log import Record
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.header import header
from outrider.errors import Fault, InputError
from outrider.logs.timeline import on_one_line

_MAX_PLAUSIBLE_M = 5000.0
_SURVEYED = {
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
}


class Part(Enum):
    """Use of a record by the companion."""

    AUTOPILOT = "autopilot"
    SWARM = "swarm"
    TARGET = "target"
    SENT = "sent"
    """A set-point, except from the own autopilot; its addressee is not checked here."""
    NOTHING = ""


@dataclass(frozen=True)
class Roles:
    """System ids of the roles; ``neighbours`` None: all systems without another role."""

    own: int
    neighbours: frozenset[int] | None = None
    target: int | None = None

    def part(self, frame: bytes) -> Part:
        """Return the companion's use of the record of ``frame``."""
        system, component, message_id = header(frame)
        from_autopilot = (system, component) == (self.own, mavlink.MAV_COMP_ID_AUTOPILOT1)
        if message_id == mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED and not from_autopilot:
            return Part.SENT
        if system == self.own:
            return Part.NOTHING if component == COMPONENT else Part.AUTOPILOT
        if system == self.target:
            return Part.TARGET
        if self.neighbours is None or system in self.neighbours:
            return Part.SWARM
        return Part.NOTHING


class OwnRecords(NamedTuple):
    """Result of a first pass over the own vehicle's records.

    ``place``: the vehicle's first position with a fix (°, °, m above mean sea level), or without any fix its
    last position, at 0°, 0°; ``above_home``: height (m) of ``place`` above home; ``origin``: its first
    GPS_GLOBAL_ORIGIN, or the origin computed from one position in both frames, or None without either;
    ``local``: whether it sends LOCAL_POSITION_NED. ``systems`` are all senders, ``placed`` those that report
    their position; ``begin`` and ``end`` of the log, µs; ``reach``: the vehicle's largest horizontal distance
    (m) from ``place``; distances of 5 km and more are ignored as implausible.
    """

    place: tuple[float, float, float]
    above_home: float
    origin: tuple[float, float, float] | None
    local: bool
    systems: frozenset[int]
    placed: frozenset[int]
    begin: int
    end: int
    reach: float

    @property
    def seconds(self) -> float:
        """Length of the log, s."""
        return (self.end - self.begin) * 1e-6

    @property
    def fleet(self) -> FleetFrame:
        """Fleet frame with its origin below (or above) the vehicle's first position, at home's altitude."""
        latitude, longitude, altitude = self.place
        return FleetFrame(latitude, longitude, altitude - self.above_home)


def survey(records: Iterable[Record], own: int, name: str) -> OwnRecords:
    """Examine all ``records`` of the log ``name``.

    Raises InputError if the vehicle ``own`` is not in it or does not report its position.
    """
    codec = Codec(lambda identifier, _system, _component: identifier in _SURVEYED)
    systems: set[int] = set()
    placed: set[int] = set()
    place: GlobalPosition | None = None
    first: LocalPosition | None = None
    pair: tuple[GlobalPosition, LocalPosition] | None = None
    origin: tuple[float, float, float] | None = None
    here: FleetFrame | None = None
    reach = 0.0
    begin: int | None = None
    end = 0
    for record in on_one_line(records):
        begin = record.time if begin is None else begin
        end = record.time
        systems.add(header(record.frame).system)
        for message in codec.feed(record.frame):
            if isinstance(message, GlobalPosition):
                placed.add(message.source.system)
            if message.source != Source(own, mavlink.MAV_COMP_ID_AUTOPILOT1):
                continue
            match message:
                case GlobalPosition():
                    # Without a fix the position is all zeros, which are used only where there is nothing
                    # better.
                    if place is None or not (place.latitude or place.longitude):
                        place, here = message, _frame(message)
                    elif here is not None and (message.latitude or message.longitude):
                        reach = max(reach, _apart(here, message))
                    if first is not None and pair is None and (message.latitude or message.longitude):
                        pair = message, first
                case LocalPosition():
                    first = message
                case GpsGlobalOrigin() if origin is None:
                    origin = message.latitude, message.longitude, message.altitude
                case _:
                    pass
    if own not in systems:
        said = ", ".join(map(str, sorted(systems))) or "nobody"
        raise InputError(f"{name}: vehicle {own} is not in it; allowed: {said}")
    if place is None:
        said = ", ".join(map(str, sorted(placed))) or "nobody does"
        raise InputError(
            f"{name}: vehicle {own} never says where it is (GLOBAL_POSITION_INT); allowed: {said}"
        )
    if origin is None and pair is not None:
        origin = _origin(*pair)
    return OwnRecords(
        (place.latitude, place.longitude, place.altitude),
        place.relative_altitude,
        origin,
        first is not None,
        frozenset(systems),
        frozenset(placed),
        begin or 0,
        end,
        reach,
    )


def _frame(place: GlobalPosition) -> FleetFrame:
    return FleetFrame(place.latitude, place.longitude, place.altitude)


def _apart(here: FleetFrame, place: GlobalPosition) -> float:
    """Return the horizontal distance, m; 0 if it is implausibly large."""
    east, north, _ = here.to_enu(place.latitude, place.longitude, place.altitude)
    far = float(np.hypot(east, north))
    return far if far < _MAX_PLAUSIBLE_M else 0.0


def _origin(place: GlobalPosition, local: LocalPosition) -> tuple[float, float, float]:
    """Return the origin of the own local frame, from one position in both frames."""
    here = _frame(place)
    north, east, down = local.position_ned
    return here.to_geodetic((-east, -north, down))


def check(log: Path, cast: Roles, seen: OwnRecords) -> None:
    """Raise InputError for a selected system that is the own vehicle or never reports its position."""
    asked = {"--target": () if cast.target is None else (cast.target,), "--neighbours": cast.neighbours or ()}
    allowed = ", ".join(map(str, sorted(seen.placed - {cast.own}))) or "nobody"
    for option, systems in asked.items():
        for system in sorted(set(systems) - seen.placed | set(systems) & {cast.own}):
            wrong = "is the own vehicle" if system == cast.own else "never says where it is"
            raise InputError(Fault(str(log), f"{option} {system} {wrong}; allowed: {allowed}"))
