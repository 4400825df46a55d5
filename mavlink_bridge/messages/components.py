"""Messages that describe a component: its flight modes and the files about it."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_bridge.messages.declaration import Definition, message
from mavlink_bridge.messages.fields import Fields, ascii_bytes, ascii_text
from mavlink_bridge.messages.source import Source

URI_LENGTH = 100
MODE_NAME_LENGTH = 35


@message(
    "COMPONENT_METADATA",
    definition=Definition(397, 182, "<II100s", ("time_boot_ms", "file_crc", "uri")),
)
class ComponentMetadata(NamedTuple):
    """COMPONENT_METADATA (397): ``uri`` of the general metadata file, and its CRC-32; ``time_boot`` µs."""

    source: Source
    time_boot: int
    crc: int
    uri: str

    @staticmethod
    def decode(source: Source, fields: Fields) -> ComponentMetadata:
        return ComponentMetadata(source, fields[0] * 1000, fields[1], ascii_text(fields[2]))

    def encode(self) -> Fields:
        return self.time_boot // 1000, self.crc, ascii_bytes("uri", self.uri, URI_LENGTH)


@message("AVAILABLE_MODES")
class AvailableMode(NamedTuple):
    """AVAILABLE_MODES (435): the mode ``number`` (from 1) of ``total``.

    ``properties`` are MAV_MODE_PROPERTY, ``standard_mode`` is MAV_STANDARD_MODE.
    """

    source: Source
    custom_mode: int
    properties: int
    total: int
    number: int
    standard_mode: int
    name: str

    @staticmethod
    def decode(source: Source, fields: Fields) -> AvailableMode:
        custom, properties, total, number, standard, name = fields
        return AvailableMode(source, custom, properties, total, number, standard, ascii_text(name))

    def encode(self) -> Fields:
        return (*self[1:6], ascii_bytes("name", self.name, MODE_NAME_LENGTH))


@message("CURRENT_MODE")
class CurrentMode(NamedTuple):
    """CURRENT_MODE (436): the mode, and the one that the user chose (0 if unknown)."""

    source: Source
    custom_mode: int
    intended_mode: int
    standard_mode: int


@message("AVAILABLE_MODES_MONITOR")
class AvailableModesMonitor(NamedTuple):
    """AVAILABLE_MODES_MONITOR (437): ``sequence`` changes with the list of modes."""

    source: Source
    sequence: int
