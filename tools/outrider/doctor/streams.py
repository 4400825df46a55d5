"""Streams that an escort needs, and their rates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.readiness import STREAMS
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity

_REQUESTED_HZ: Final = {number: 1e6 / each for number, each in STREAMS.items()}
"""Requested rates (Hz) by message id."""


class StreamRequirement(NamedTuple):
    """Requirement for one message.

    ``wanted``: rate (Hz) that ``fly`` requests (except for GLOBAL_POSITION_INT, which it does not request);
    ``least``: rate (Hz) that suffices; ``essential``: an escort is impossible without the message.
    """

    message_id: int
    name: str
    wanted: float
    least: float
    essential: bool
    why: str


NEEDS: Final = (
    StreamRequirement(
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        "LOCAL_POSITION_NED",
        _REQUESTED_HZ[mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED],
        2.0,
        True,
        "Every plan begins at this position.",
    ),
    StreamRequirement(
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        "ATTITUDE",
        _REQUESTED_HZ[mavlink.MAVLINK_MSG_ID_ATTITUDE],
        2.0,
        True,
        "It gives the heading at which the set-points begin.",
    ),
    StreamRequirement(
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        "SYS_STATUS",
        _REQUESTED_HZ[mavlink.MAVLINK_MSG_ID_SYS_STATUS],
        0.2,
        True,
        "It has the pre-arm check and the battery.",
    ),
    StreamRequirement(
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        "EXTENDED_SYS_STATE",
        _REQUESTED_HZ[mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE],
        0.5,
        False,
        "It tells whether an armed vehicle is on the ground or in the air.",
    ),
    StreamRequirement(
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        "GLOBAL_POSITION_INT",
        1.0,
        0.2,
        False,
        "Others see by it where this vehicle is, and it checks the local position.",
    ),
)
_MIN_RATE_RATIO: Final = 0.85
_MIN_SILENCE_S: Final = 5.0
"""Shortest silence (s) after which a streamed message counts as stopped."""
_MIN_SILENT_INTERVALS: Final = 10.0


def streams(case: Case, asked: dict[int, int]) -> Iterator[Finding]:
    """Yield a finding for each required message; ``asked``: the doctor's own requests by message id."""
    for need in NEEDS:
        yield _judge(case, need, asked.get(need.message_id, 0))


def _judge(case: Case, need: StreamRequirement, asked: int) -> Finding:
    stream = case.vehicle.streams.get(need.message_id)
    name = need.name
    order = f"SET_MESSAGE_INTERVAL {need.message_id} at {1e6 / need.wanted:.0f} µs"
    if stream is None:
        return Finding(
            f"{name} does not come",
            Severity.BLOCKING if need.essential else Severity.WARNING,
            f"{need.why} It is missing in the log: it was not requested, or the autopilot does not have it."
            if case.log
            else f"{need.why} It was asked for and did not come.",
            f"Record it: {order}."
            if case.log
            else "If GPS or estimator are bad, correct them first; otherwise check that the link has the "
            "capacity for it.",
        )
    if stream.count <= max(asked, 1):
        return Finding(
            f"{name} comes only when asked",
            Severity.NOTE,
            need.why,
            f"Nothing: fly asks for {need.wanted:g} Hz ({order}).",
        )
    rate = case.vehicle.rate(need.message_id)
    silence = case.silent_for(need.message_id)
    if silence > max(_MIN_SILENCE_S, _MIN_SILENT_INTERVALS / rate if rate else 0.0):
        return Finding(
            f"{name} has stopped, {silence:.0f} s ago",
            Severity.BLOCKING if need.essential and not case.log else Severity.WARNING,
            need.why,
            "It ends before the log does." if case.log else "See what happened to GPS, estimator or link.",
        )
    what = f"{name} at {rate:.3g} Hz"
    if rate >= _MIN_RATE_RATIO * need.wanted:
        return Finding(what, Severity.OK, need.why)
    if rate >= need.least:
        return Finding(what, Severity.NOTE, need.why, f"Nothing: fly asks for {need.wanted:g} Hz ({order}).")
    return Finding(
        what,
        Severity.WARNING,
        f"{need.why} Below {need.least:g} Hz a companion may at times treat it as lost.",
        f"fly asks for {need.wanted:g} Hz ({order}); see that the link has room for it (57 600 baud carry "
        "5.8 kB/s).",
    )
