"""Events from a vehicle's log: arming and modes from heartbeats, texts, and refused commands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from pymavlink.dialects.v20 import all as dialect

from mavlink_bridge.messages import CommandAck, Heartbeat, StatusText
from outrider.report.run import Log

ARMED = 0x80
"""MAV_MODE_FLAG_SAFETY_ARMED."""
_ACCEPTED, _IN_PROGRESS = 0, 5
_PX4 = 12
_ARDUCOPTER = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    4: "GUIDED",
    5: "LOITER",
    6: "RTL",
    7: "CIRCLE",
    9: "LAND",
    16: "POSHOLD",
    17: "BRAKE",
    21: "SMART_RTL",
}
_PX4_MAIN = {1: "MANUAL", 2: "ALTCTL", 3: "POSCTL", 4: "AUTO", 5: "ACRO", 6: "OFFBOARD", 7: "STABILIZED"}
_PX4_AUTO = {1: "READY", 2: "TAKEOFF", 3: "LOITER", 4: "MISSION", 5: "RTL", 6: "LAND"}
_SEVERE = 4
"""MAV_SEVERITY_WARNING; a lower number is more severe."""
_SEVERITIES = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
_PIECE = 50
"""A STATUSTEXT of this length continues in the next one."""


class Saying(NamedTuple):
    """Event at ``time`` µs on the clock of the log.

    ``kind`` is armed, mode, text or refused; ``bad`` marks an event that needs attention.
    """

    time: int
    kind: str
    text: str
    bad: bool = False


def sayings(log: Log) -> Iterator[Saying]:
    """Yield the events in the order of the log.

    The first heartbeat gives the initial state. A long STATUSTEXT that arrives in pieces is joined.
    """
    before: Heartbeat | None = None
    text: Saying | None = None
    for time, said in log.utterances:
        if isinstance(said, StatusText):
            if text is not None and text.time == time:
                text = text._replace(text=text.text + said.text)
            else:
                if text is not None:
                    yield text
                text = _text(time, said)
            if len(said.text) < _PIECE:
                yield text
                text = None
            continue
        if text is not None:
            yield text
            text = None
        if isinstance(said, CommandAck):
            if said.result not in (_ACCEPTED, _IN_PROGRESS):
                yield Saying(time, "refused", f"{command(said.command)}: {_result(said.result)}", bad=True)
        elif isinstance(said, Heartbeat):
            yield from _changes(time, before, said)
            before = said
    if text is not None:
        yield text


def mode(heartbeat: Heartbeat) -> str:
    """Return the autopilot's name of the mode."""
    number = heartbeat.custom_mode
    if heartbeat.autopilot != _PX4:
        return _ARDUCOPTER.get(number, f"mode {number}")
    main, sub = number >> 16 & 0xFF, number >> 24
    name = _PX4_MAIN.get(main, f"mode {main}")
    return f"{name} {_PX4_AUTO.get(sub, sub)}" if main == 4 and sub else name


def command(number: int) -> str:
    """Return MAVLink's name of a command, without the prefix."""
    entry = dialect.enums["MAV_CMD"].get(number)
    return str(entry.name).removeprefix("MAV_CMD_") if entry is not None else f"command {number}"


def _result(number: int) -> str:
    entry = dialect.enums["MAV_RESULT"].get(number)
    return str(entry.name).removeprefix("MAV_RESULT_").lower() if entry is not None else f"result {number}"


def _text(time: int, said: StatusText) -> Saying:
    severity = min(said.severity, len(_SEVERITIES) - 1)
    return Saying(time, "text", f"{_SEVERITIES[severity]}: {said.text}", bad=severity < _SEVERE)


def _changes(time: int, before: Heartbeat | None, now: Heartbeat) -> Iterator[Saying]:
    if before is None:
        yield Saying(time, "mode", f"{mode(now)}, {'armed' if now.base_mode & ARMED else 'disarmed'}")
        return
    if (before.base_mode ^ now.base_mode) & ARMED:
        yield Saying(time, "armed", "armed" if now.base_mode & ARMED else "disarmed")
    if before.custom_mode != now.custom_mode:
        yield Saying(time, "mode", f"{mode(before)} → {mode(now)}")
