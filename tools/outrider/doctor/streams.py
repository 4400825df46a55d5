"""Streams that an escort needs, and their rates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from companion.flight.readiness import STREAMS
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity

_ASKED: Final = {number: 1e6 / each for number, each in STREAMS.items()}
"""Requested rates (Hz) by message id."""


class StreamRequirement(NamedTuple):
    """Requirement for one message.

    ``wanted``: rate (Hz) that ``fly`` requests; ``least``: rate that suffices; ``essential``: an escort is
    impossible without the message.
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
        _ASKED[mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED],
        2.0,
        True,
        "Every plan begins where this says that it is.",
    ),
    StreamRequirement(
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        "ATTITUDE",
        _ASKED[mavlink.MAVLINK_MSG_ID_ATTITUDE],
        2.0,
        True,
        "It says where the nose points when set-points begin.",
    ),
    StreamRequirement(
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        "SYS_STATUS",
        _ASKED[mavlink.MAVLINK_MSG_ID_SYS_STATUS],
        0.2,
        True,
        "It has the pre-arm check and the battery.",
    ),
    StreamRequirement(
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        "EXTENDED_SYS_STATE",
        _ASKED[mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE],
        0.5,
        False,
        "It says whether an armed vehicle stands or flies.",
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
_NEARLY: Final = 0.85
_GONE: Final = 5.0
"""Shortest silence (s) after which a streamed message counts as stopped."""
_INTERVALS: Final = 10.0


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
            f"{need.why} It is missing in the log: nobody asked for it, or the autopilot has none to tell."
            if case.log
            else f"{need.why} It was asked for and did not come.",
            f"Record it: {order}."
            if case.log
            else "If GPS and estimator are bad, mend them first; else see that the link carries what is "
            "asked for.",
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
    if silence > max(_GONE, _INTERVALS / rate if rate else 0.0):
        return Finding(
            f"{name} has stopped, {silence:.0f} s ago",
            Severity.BLOCKING if need.essential and not case.log else Severity.WARNING,
            need.why,
            "It ends before the log does." if case.log else "See what happened to GPS, estimator or link.",
        )
    what = f"{name} at {rate:.3g} Hz"
    if rate >= _NEARLY * need.wanted:
        return Finding(what, Severity.OK, need.why)
    if rate >= need.least:
        return Finding(what, Severity.NOTE, need.why, f"Nothing: fly asks for {need.wanted:g} Hz ({order}).")
    return Finding(
        what,
        Severity.WARNING,
        f"{need.why} Slower than {need.least:g} Hz is taken for lost from time to time.",
        f"fly asks for {need.wanted:g} Hz ({order}); see that the link has room for it (57 600 baud carry "
        "5.8 kB/s).",
    )
