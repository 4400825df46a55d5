"""Events from a vehicle's log: arming and modes from heartbeats, texts, and refused commands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import CommandAck, Heartbeat, StatusText
from outrider.logs.flight_modes import is_armed, mode_of
from outrider.report.run import Log

_SEVERITIES = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
_PIECE_LENGTH = 50
"""Length of a full STATUSTEXT: only a text of this length may continue in the next one."""


class LogEvent(NamedTuple):
    """Event at ``time`` µs on the clock of the log.

    ``kind`` is armed, mode, text or refused; ``bad`` marks an event that needs attention.
    """

    time: int
    kind: str
    text: str
    bad: bool = False


def sayings(log: Log) -> Iterator[LogEvent]:
    """Yield the events in the order of the log.

    The first heartbeat gives the initial state. Successive pieces of a long STATUSTEXT with the same time
    are joined.
    """
    before: Heartbeat | None = None
    text: LogEvent | None = None
    for time, said in log.utterances:
        if isinstance(said, StatusText):
            if text is not None and text.time == time:
                text = text._replace(text=text.text + said.text)
            else:
                if text is not None:
                    yield text
                text = _text(time, said)
            if len(said.text) < _PIECE_LENGTH:
                yield text
                text = None
            continue
        if text is not None:
            yield text
            text = None
        if isinstance(said, CommandAck):
            if said.result not in (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS):
                yield LogEvent(time, "refused", f"{command(said.command)}: {_result(said.result)}", bad=True)
        elif isinstance(said, Heartbeat):
            yield from _changes(time, before, said)
            before = said
    if text is not None:
        yield text


def command(number: int) -> str:
    """Return MAVLink's name of a command, without the prefix."""
    entry = mavlink.enums["MAV_CMD"].get(number)
    return str(entry.name).removeprefix("MAV_CMD_") if entry is not None else f"command {number}"


def _result(number: int) -> str:
    entry = mavlink.enums["MAV_RESULT"].get(number)
    return str(entry.name).removeprefix("MAV_RESULT_").lower() if entry is not None else f"result {number}"


def _text(time: int, said: StatusText) -> LogEvent:
    severity = min(said.severity, len(_SEVERITIES) - 1)
    return LogEvent(
        time, "text", f"{_SEVERITIES[severity]}: {said.text}", bad=severity < mavlink.MAV_SEVERITY_WARNING
    )


def _changes(time: int, before: Heartbeat | None, now: Heartbeat) -> Iterator[LogEvent]:
    state = "armed" if is_armed(now) else "disarmed"
    if before is None:
        yield LogEvent(time, "mode", f"{mode_of(now)}, {state}")
        return
    if is_armed(before) != is_armed(now):
        yield LogEvent(time, "armed", state)
    if before.custom_mode != now.custom_mode:
        yield LogEvent(time, "mode", f"{mode_of(before)} → {mode_of(now)}")
