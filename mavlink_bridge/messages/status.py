"""Messages of a vehicle's state: mode, battery, landing, fence, estimator, texts, version."""

from __future__ import annotations

from itertools import takewhile
from typing import NamedTuple

from mavlink_bridge.errors import EncodeError
from mavlink_bridge.messages.declaration import message
from mavlink_bridge.messages.fields import UNKNOWN_U16, Fields, or_unknown
from mavlink_bridge.messages.source import Source

_CELLS = 10
_AMPERE_SECONDS_PER_MAH = 3.6
TEXT_LENGTH = 50


@message("HEARTBEAT")
class Heartbeat(NamedTuple):
    """HEARTBEAT (0)."""

    source: Source
    type: int
    autopilot: int
    base_mode: int
    custom_mode: int
    system_status: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> Heartbeat:
        custom_mode, kind, autopilot, base_mode, status, _ = fields
        return Heartbeat(source, kind, autopilot, base_mode, custom_mode, status)

    def encode(self) -> Fields:
        return self.custom_mode, self.type, self.autopilot, self.base_mode, self.system_status, 3


@message("SYS_STATUS", finite=True, size_v1=31)
class SysStatus(NamedTuple):
    """SYS_STATUS (1): sensor bit masks; battery voltage (V) and remaining charge (0…1), None if unknown."""

    source: Source
    present: int
    enabled: int
    health: int
    battery_voltage: float | None
    battery_remaining: float | None

    @staticmethod
    def decode(source: Source, fields: Fields) -> SysStatus:
        voltage, remaining = fields[4], fields[12]
        return SysStatus(
            source,
            fields[0],
            fields[1],
            fields[2],
            None if voltage == UNKNOWN_U16 else voltage / 1e3,
            remaining / 100 if 0 <= remaining <= 100 else None,
        )

    def encode(self) -> Fields:
        voltage, remaining = UNKNOWN_U16, -1
        if self.battery_voltage is not None:
            voltage = round(self.battery_voltage * 1e3)
            if voltage == UNKNOWN_U16:
                raise EncodeError(
                    f"SYS_STATUS: battery_voltage = {self.battery_voltage} V would read as unknown"
                )
        if self.battery_remaining is not None:
            remaining = round(self.battery_remaining * 100)
            if not 0 <= remaining <= 100:
                raise EncodeError(f"SYS_STATUS: battery_remaining = {self.battery_remaining} is outside 0…1")
        return self.present, self.enabled, self.health, 0, voltage, -1, 0, 0, 0, 0, 0, 0, remaining, 0, 0, 0


@message("BATTERY_STATUS", size_v1=36)
class BatteryStatus(NamedTuple):
    """BATTERY_STATUS (147).

    ``voltages`` (V) of up to ten cells, or the total voltage as the only one; ``current`` (A); ``consumed``
    (A s); ``remaining`` 0…1; ``time_remaining`` (s, 0 if unknown); ``charge_state`` is
    MAV_BATTERY_CHARGE_STATE.
    """

    source: Source
    id: int
    function: int
    type: int
    voltages: tuple[float, ...]
    current: float | None
    consumed: float | None
    remaining: float | None
    time_remaining: int
    charge_state: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> BatteryStatus:
        consumed, cells, current, remaining = fields[0], fields[3:13], fields[13], fields[17]
        voltages = tuple(cell / 1e3 for cell in takewhile(lambda cell: cell != UNKNOWN_U16, cells))
        return BatteryStatus(
            source,
            fields[14],
            fields[15],
            fields[16],
            voltages,
            None if current == -1 else current / 100,
            None if consumed == -1 else consumed * _AMPERE_SECONDS_PER_MAH,
            remaining / 100 if 0 <= remaining <= 100 else None,
            fields[18],
            fields[19],
        )

    def encode(self) -> Fields:
        if len(self.voltages) > _CELLS:
            raise EncodeError(f"BATTERY_STATUS: {len(self.voltages)} cells are more than {_CELLS}")
        cells = [or_unknown("voltages", cell, 1e3) for cell in self.voltages]
        remaining = -1 if self.remaining is None else round(self.remaining * 100)
        if not -1 <= remaining <= 100:
            raise EncodeError(f"BATTERY_STATUS: remaining = {self.remaining} is outside 0…1")
        return (
            -1 if self.consumed is None else round(self.consumed / _AMPERE_SECONDS_PER_MAH),
            -1,
            0x7FFF,
            *cells,
            *[UNKNOWN_U16] * (_CELLS - len(cells)),
            -1 if self.current is None else round(self.current * 100),
            self.id,
            self.function,
            self.type,
            remaining,
            self.time_remaining,
            self.charge_state,
            *[0] * 6,
        )


@message("EXTENDED_SYS_STATE")
class ExtendedSysState(NamedTuple):
    """EXTENDED_SYS_STATE (245): ``landed_state`` is MAV_LANDED_STATE."""

    source: Source
    vtol_state: int
    landed_state: int


@message("FENCE_STATUS", size_v1=8)
class FenceStatus(NamedTuple):
    """FENCE_STATUS (162): time of the breach (µs since boot), kind (FENCE_BREACH), and number of breaches."""

    source: Source
    time_boot: int
    breached: bool
    breaches: int
    kind: int

    @staticmethod
    def decode(source: Source, fields: Fields) -> FenceStatus:
        time, count, breached, kind, _ = fields
        return FenceStatus(source, time * 1000, bool(breached), count, kind)

    def encode(self) -> Fields:
        return self.time_boot // 1000, self.breaches, int(self.breached), self.kind, 0


@message("EKF_STATUS_REPORT", size_v1=22)
class EkfStatus(NamedTuple):
    """EKF_STATUS_REPORT (193, ardupilotmega).

    ``flags`` are EKF_STATUS_FLAGS; the rest are innovation test ratios (innovation over gate; good below 1).
    """

    source: Source
    flags: int
    velocity: float = 0.0
    horizontal: float = 0.0
    vertical: float = 0.0
    magnetic: float = 0.0

    @staticmethod
    def decode(source: Source, fields: Fields) -> EkfStatus:
        return EkfStatus(source, fields[5], *fields[:4])

    def encode(self) -> Fields:
        return self.velocity, self.horizontal, self.vertical, self.magnetic, 0.0, self.flags, 0.0


@message("ESTIMATOR_STATUS")
class EstimatorStatus(NamedTuple):
    """ESTIMATOR_STATUS (230).

    Innovation test ratios (PX4: squares of innovation over gate; good below 1, NaN if not tested), accuracies
    (m), ESTIMATOR_STATUS_FLAGS. ``time`` µs since boot.
    """

    source: Source
    time: int
    velocity: float
    horizontal: float
    vertical: float
    magnetic: float
    above_ground: float
    airspeed: float
    horizontal_accuracy: float
    vertical_accuracy: float
    flags: int


@message("STATUSTEXT", size_v1=51)
class StatusText(NamedTuple):
    """STATUSTEXT (253): one message carries 50 characters; ``Codec.encode`` splits a longer ``text``."""

    source: Source
    severity: int
    text: str

    @staticmethod
    def decode(source: Source, fields: Fields) -> StatusText:
        return StatusText(source, fields[0], fields[1].split(b"\0", 1)[0].decode("utf-8", errors="replace"))

    def encode(self) -> Fields:
        return self.severity, text_bytes(self.text)[:TEXT_LENGTH], 0, 0


@message("AUTOPILOT_VERSION", size_v1=60)
class AutopilotVersion(NamedTuple):
    """AUTOPILOT_VERSION (148).

    ``capabilities`` are MAV_PROTOCOL_CAPABILITY. A version number has four bytes, the major version in the
    most significant one. Custom versions have eight bytes, ``uid2`` has 18.
    """

    source: Source
    capabilities: int
    uid: int
    flight_version: int
    middleware_version: int
    os_version: int
    board_version: int
    vendor: int
    product: int
    flight_custom: bytes
    middleware_custom: bytes
    os_custom: bytes
    uid2: bytes


def text_bytes(text: str) -> bytes:
    """Return ``text`` in ASCII, with a question mark for any other character and a space for NUL.

    A NUL would end the text.
    """
    return text.replace("\0", " ").encode("ascii", errors="replace")


def text_chunks(text: str) -> list[bytes]:
    """Split ``text`` into at most 255 pieces (their number is one byte) of 50 bytes; cut a longer text.

    The last piece is shorter, possibly empty: its NUL indicates that the text is complete.
    """
    data = text_bytes(text)[: TEXT_LENGTH * 255 - 1]
    return [data[at : at + TEXT_LENGTH] for at in range(0, len(data) + 1, TEXT_LENGTH)]
