"""Messages between the checks before a certified flight, each in a TUNNEL.

A *probe* has the size of a committed plan, so that a link is measured with messages as in flight. A *report*
has what one vehicle has measured, in one or more parts. A *turn* says how far a vehicle is that flies alone.

Sizes in bytes, little endian. Both: kind 1, run 4 (a random number of the sending process), fingerprint of
the fleet's common settings 4. Probe: sequence number 4, time 7 (µs, the sender's clock), 0xFF up to 128.
Report: flags 1 (bit 0: passed; bits 1, 2, 3: σ, clock, tube are known; bits 4, 5, 6: the file states them),
part 1, number of parts 1, autopilot 1 (MAV_AUTOPILOT), UTC 4 (s), σ 2 (mm), clock 4 (µs), tube 2 (mm), then
the links: peer 1, loss 2 (1/10 000), jitter 2 (0.1 ms), round trip 2 (0.1 ms; 65 535: unknown).
Turn: kind 3, run 4, fingerprint 4, stage 1, 1 if the vehicle is disarmed.
"""

from __future__ import annotations

from enum import Enum
from struct import Struct
from struct import error as StructError  # noqa: N812
from typing import NamedTuple

from mavlink_bridge.errors import PlanWireError

PAYLOAD_TYPE = 0xDC06
"""TUNNEL.payload_type; values above 32767 are free for private use."""
PROBE, REPORT, TURN = 1, 2, 3
_SIZE = 128
_PROBE = Struct("<BIII7s")
_REPORT = Struct("<BIIBBBBIHIH")
_LINK = Struct("<BHHH")
_TURN = Struct("<BIIBB")
LINKS_PER_PART = (_SIZE - _REPORT.size) // _LINK.size
"""Largest number of links in one part of a report."""
_KNOWN, _STATED = 1, 4
"""Bit of the first of three flags: whether a figure is known, and whether the file states the setting."""
_FLAGS = 0x7F
MOST, UNKNOWN = 65_534, 65_535
"""Largest value of two bytes that is a figure, and the value that says there is none."""


class Probe(NamedTuple):
    """Message ``sequence`` of the process ``run``, sent at ``time`` (µs, the sender's clock)."""

    run: int
    fingerprint: int
    sequence: int
    time: int


class LinkReport(NamedTuple):
    """Link from ``peer`` to the sender of the report: ``loss`` in 1/10 000; jitter and round trip in 0.1 ms.

    ``round_trip``: None if no request was answered.
    """

    peer: int
    loss: int
    jitter: int
    round_trip: int | None


class Stage(Enum):
    """Stage of a vehicle in the flights alone."""

    CHECKS = 0
    """On-ground checks are not over."""
    READY = 1
    FLIES = 2
    LANDED = 3
    ENDED = 4
    """It does not fly, or not any more, and its tube was not measured."""


class Turn(NamedTuple):
    """Stage of the vehicle of the process ``run``; ``disarmed``: a heartbeat of the last seconds says so."""

    run: int
    fingerprint: int
    stage: Stage
    disarmed: bool


class Report(NamedTuple):
    """What the process ``run`` has measured; this is ``part`` (0…) of ``parts``.

    ``passed``: whether its vehicle passes. ``figures``: σ (mm), bound of the clock (µs) and tube (mm), None
    if unknown; ``stated``: whether the vehicle's file states each of these settings. ``utc`` (s): time of the
    report.
    """

    run: int
    fingerprint: int
    passed: bool
    stated: tuple[bool, bool, bool]
    part: int
    parts: int
    autopilot: int
    utc: int
    figures: tuple[int | None, int | None, int | None]
    links: tuple[LinkReport, ...]


def pack(message: Probe | Report | Turn) -> bytes:
    """Encode ``message``; raise PlanWireError for a value that does not fit."""
    try:
        if isinstance(message, Turn):
            return _TURN.pack(TURN, message.run, message.fingerprint, message.stage.value, message.disarmed)
        return _packed_probe(message) if isinstance(message, Probe) else _packed_report(message)
    except (OverflowError, StructError):
        raise PlanWireError(f"out of range of the wire: {message}") from None


def _packed_probe(probe: Probe) -> bytes:
    time = probe.time.to_bytes(7, "little")
    data = _PROBE.pack(PROBE, probe.run, probe.fingerprint, probe.sequence, time)
    return data.ljust(_SIZE, b"\xff")


def _packed_report(report: Report) -> bytes:
    if len(report.links) > LINKS_PER_PART or not report.part < report.parts:
        raise PlanWireError(f"part {report.part} of {report.parts} with {len(report.links)} links")
    flags = int(report.passed)
    for number, (figure, stated) in enumerate(zip(report.figures, report.stated, strict=True)):
        flags |= (figure is not None) << (_KNOWN + number) | stated << (_STATED + number)
    head = (REPORT, report.run, report.fingerprint, flags, report.part, report.parts, report.autopilot)
    data = _REPORT.pack(*head, report.utc, *(figure or 0 for figure in report.figures))
    for peer, loss, jitter, round_trip in report.links:
        data += _LINK.pack(peer, loss, jitter, UNKNOWN if round_trip is None else round_trip)
    return data


def unpack(data: bytes) -> Probe | Report | Turn:
    """Decode a message; raise PlanWireError for anything that ``pack`` cannot produce."""
    if len(data) == _TURN.size and data[0] == TURN:
        _, run, fingerprint, stage, disarmed = _TURN.unpack(data)
        if stage > Stage.ENDED.value or disarmed > 1:
            raise PlanWireError(f"a turn with stage {stage} and {disarmed} is not valid")
        return Turn(run, fingerprint, Stage(stage), bool(disarmed))
    if len(data) == _SIZE and data[0] == PROBE and not data[_PROBE.size :].strip(b"\xff"):
        _, run, fingerprint, sequence, time = _PROBE.unpack_from(data)
        return Probe(run, fingerprint, sequence, int.from_bytes(time, "little"))
    size = len(data) - _REPORT.size
    if not 0 <= size <= _SIZE - _REPORT.size or size % _LINK.size or data[0] != REPORT:
        raise PlanWireError(f"{len(data)} bytes are no message of a check before a flight")
    _, run, fingerprint, flags, part, parts, autopilot, utc, *found = _REPORT.unpack_from(data)
    links = tuple(
        LinkReport(peer, loss, jitter, None if round_trip == UNKNOWN else round_trip)
        for peer, loss, jitter, round_trip in _LINK.iter_unpack(data[_REPORT.size :])
    )
    sigma, clock, tube = (
        value if flags >> (_KNOWN + number) & 1 else None for number, value in enumerate(found)
    )
    hidden = any(value and flag is None for value, flag in zip(found, (sigma, clock, tube), strict=True))
    if flags & ~_FLAGS or not part < parts or hidden:
        raise PlanWireError(f"a report with flags {flags}, part {part} of {parts} is not valid")
    if any(not link.peer or link.loss > 10_000 for link in links):
        raise PlanWireError("a report on a link that cannot be")
    of_sigma, of_clock, of_tube = (bool(flags >> (_STATED + number) & 1) for number in range(3))
    return Report(
        run,
        fingerprint,
        bool(flags & 1),
        (of_sigma, of_clock, of_tube),
        part,
        parts,
        autopilot,
        utc,
        (sigma, clock, tube),
        links,
    )
