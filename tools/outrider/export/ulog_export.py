"""Export of logs as ULogs, one for each vehicle.

Every message type is a topic ``mavlink_name``, with an instance for each sender and link; the data is the
raw payload. The messages of the vehicle's own autopilot, and the set-points sent to it, are also converted to
PX4's topics.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from outrider.errors import InputError
from outrider.export.px4_topics import TOPICS, Px4Topics
from outrider.export.ulog_file import Topic, UlogFile
from outrider.export.written import Written
from outrider.logs.dialect import Kind
from outrider.logs.message_stream import Log, LogMessage, Watch, watched
from outrider.runs.source import Run

SECOND: Final = 1_000_000
_SURVEYED = 0.3
"""Progress (0…1) at the end of the first pass, which finds first times, message types and vehicles."""
_HEAD = (("uint8_t", "link"), ("uint8_t", "system"), ("uint8_t", "component"))


class LogContents(NamedTuple):
    """Contents of a log: its first time (Unix µs), its message types, and the system ids of vehicles.

    A vehicle is a system with an autopilot.
    """

    first: int
    kinds: frozenset[Kind]
    vehicles: frozenset[int]


def write(run: Run, folder: Path, watch: Watch) -> Written:
    """Write ``vehicle-N.ulg`` for each vehicle to ``folder``.

    All files start at the same time, one second before the first message of any log, rounded down to a whole
    second, so that they can be overlaid. Raises InputError if there is no vehicle.
    """
    logs = list(run.logs)
    streams = watched(logs, watch, (0.0, _SURVEYED))
    found = [survey(messages) for messages in streams]
    zero = max(min((one.first for one in found), default=0) // SECOND * SECOND - SECOND, 0)
    if not any(_vehicles(log, one) for log, one in zip(logs, found, strict=True)):
        raise InputError(f"{run.source}: no vehicle speaks in it: no HEARTBEAT of an autopilot")
    parts = []
    for log, one, stream in zip(logs, found, watched(logs, watch, (_SURVEYED, 1.0)), strict=True):
        parts += _write(log, one, stream, folder, zero)
    return Written(*(sum(column) for column in zip(*parts, strict=True)))


def survey(messages: Iterable[LogMessage]) -> LogContents:
    """Read a log once and return its contents."""
    first, kinds, vehicles = -1, set(), set()
    for spoken in messages:
        first = spoken.time if first < 0 else min(first, spoken.time)
        kinds.add(spoken.kind)
        if _is_vehicle(spoken):
            vehicles.add(spoken.system)
    return LogContents(max(first, 0), frozenset(kinds), frozenset(vehicles))


def _is_vehicle(spoken: LogMessage) -> bool:
    """Return whether the message is the heartbeat of an autopilot."""
    if spoken.kind.name != "HEARTBEAT" or spoken.component != mavlink.MAV_COMP_ID_AUTOPILOT1:
        return False
    return bool(spoken.kind.read(spoken.payload)["autopilot"] != mavlink.MAV_AUTOPILOT_INVALID)


def _vehicles(log: Log, found: LogContents) -> list[int]:
    """Return the vehicles that get a file: the owner of a log in a run, otherwise every vehicle in it."""
    return sorted(found.vehicles) if log.owner is None else [log.owner]


def _write(
    log: Log, found: LogContents, messages: Iterable[LogMessage], folder: Path, zero: int
) -> list[Written]:
    vehicles = _vehicles(log, found)
    kinds = sorted(found.kinds, key=lambda kind: kind.id)
    with ExitStack() as files:
        converters = {
            system: _VehicleConverter(
                files.enter_context(_file(folder, system, zero, kinds)), system, zero, log.owner is not None
            )
            for system in vehicles
        }
        for spoken in messages:
            if len(converters) == 1 or spoken.system not in converters:
                for converter in converters.values():
                    converter.add(spoken)
            else:
                converters[spoken.system].add(spoken)
        written = [converter.file for converter in converters.values()]
        return [Written(file.subscriptions, file.messages, file.out_of_order) for file in written]


def _file(folder: Path, system: int, zero: int, kinds: list[Kind]) -> UlogFile:
    information: dict[str, str | int] = {
        "sys_name": "outrider",
        "ver_sw": version("outrider"),
        "sys_uuid": f"MAVLink system {system}",
        "time_zero_unix_us": zero,
    }
    topics = [*TOPICS, *map(mavlink_topic, kinds)]
    return UlogFile(folder / f"vehicle-{system}.ulg", 0, information, topics)


class _VehicleConverter:
    """Converter of messages to the file of one vehicle.

    ``by_link`` sets whether topics have separate instances for each link: in a log outside a run the low bits
    of the time stamps may not be link numbers.
    """

    def __init__(self, file: UlogFile, system: int, zero: int, by_link: bool) -> None:
        self.file = file
        self._system, self._zero, self._by_link = system, zero, by_link
        self._px4 = Px4Topics(system, mavlink.MAV_COMP_ID_AUTOPILOT1)

    def add(self, spoken: LogMessage) -> None:
        """Write a message, its conversion to PX4's topics, and its text if it is a STATUSTEXT."""
        kind, payload, time = spoken.kind, spoken.payload, spoken.time - self._zero
        link = spoken.link if self._by_link else 0
        head = bytes((spoken.link, spoken.system, spoken.component))
        self.file.data(time, mavlink_topic(kind), (link, spoken.system, spoken.component), head + payload)
        own = (spoken.system, spoken.component) == (self._system, mavlink.MAV_COMP_ID_AUTOPILOT1)
        for view in (self._px4.said if own else self._px4.reported)(kind, payload):
            self.file.data(time, view.topic, link, view.values)
        if kind.name == "STATUSTEXT":
            said = kind.read(payload)
            who = "" if own else f"[{spoken.system}/{spoken.component}] "
            self.file.say(time, said["severity"], f"{who}{said['text']}")


@cache
def mavlink_topic(kind: Kind) -> Topic:
    """Return the topic of a message type: its fields in wire order, so that the payload is written unchanged.

    A field with the name of one of the added fields gets an underscore.
    """
    taken = {"timestamp", *(name for _, name in _HEAD)}
    fields = []
    for field in kind.wire:
        size = f"[{field.length}]" if field.length else ""
        fields.append((f"{field.type}{size}", f"{field.name}_" if field.name in taken else field.name))
    return Topic(f"mavlink_{kind.name.lower()}", (*_HEAD, *fields))
