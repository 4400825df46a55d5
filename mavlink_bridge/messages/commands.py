"""Messages of commands: COMMAND_INT, COMMAND_LONG, their acknowledgement, mode and rates of messages."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import Fields
from mavlink_bridge.messages.source import Source


@message("COMMAND_INT")
class CommandInt(NamedTuple):
    """COMMAND_INT (75); ``x``, ``y`` are the raw int32 (degE7 in global frames)."""

    source: Source
    target_system: int
    target_component: int
    frame: int
    command: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float

    @staticmethod
    def decode(source: Source, fields: Fields) -> CommandInt:
        p1, p2, p3, p4, x, y, z, command, system, component, frame, _, _ = fields
        return CommandInt(source, system, component, frame, command, (p1, p2, p3, p4), x, y, z)

    def encode(self) -> Fields:
        return (
            *self.params,
            self.x,
            self.y,
            self.z,
            self.command,
            self.target_system,
            self.target_component,
            self.frame,
            0,
            0,
        )


@message("COMMAND_LONG")
class CommandLong(NamedTuple):
    """COMMAND_LONG (76): seven parameters as sent."""

    source: Source
    target_system: int
    target_component: int
    command: int
    confirmation: int
    params: tuple[float, float, float, float, float, float, float]

    @staticmethod
    def decode(source: Source, fields: Fields) -> CommandLong:
        return CommandLong(source, fields[8], fields[9], fields[7], fields[10], fields[:7])

    def encode(self) -> Fields:
        return *self.params, self.command, self.target_system, self.target_component, self.confirmation


@message("COMMAND_ACK", size_v1=3)
class CommandAck(NamedTuple):
    """COMMAND_ACK (77)."""

    source: Source
    command: int
    result: int
    progress: int
    result_param2: int
    target_system: int
    target_component: int


@message("SET_MODE")
class SetMode(NamedTuple):
    """SET_MODE (11), which older tools send instead of MAV_CMD_DO_SET_MODE."""

    source: Source
    custom_mode: int
    target_system: int
    base_mode: int


@message("REQUEST_DATA_STREAM")
class RequestDataStream(NamedTuple):
    """REQUEST_DATA_STREAM (66): ``rate`` in Hz; ``start``: 1 starts, 0 stops the stream."""

    source: Source
    rate: int
    target_system: int
    target_component: int
    stream: int
    start: int


LONGEST_INTERVAL = 0x7FFF_FFFF
"""µs: the longest interval (36 min) that MESSAGE_INTERVAL can state."""


@message("MESSAGE_INTERVAL")
class MessageInterval(NamedTuple):
    """MESSAGE_INTERVAL (244): ``interval`` in µs; −1: not sent; 0: no such message."""

    source: Source
    interval: int
    message_id: int
