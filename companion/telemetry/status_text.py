"""Status texts for the ground (STATUSTEXT), at a bounded rate."""

from __future__ import annotations

from enum import IntEnum

from pymavlink.dialects.v20 import all as mavlink

from companion.config.flight import GroundMessagesConfig
from mavlink_bridge.messages import Source, StatusText

_PERIOD_US, _BURST = 1_000_000, 5
"""µs per text, and the number of texts that may be sent at once after a pause."""
_MAX_WAITING = 16
"""Maximum number of waiting texts; beyond that the least severe is dropped."""


class Severity(IntEnum):
    """Used values of MAV_SEVERITY."""

    CRITICAL = mavlink.MAV_SEVERITY_CRITICAL
    ERROR = mavlink.MAV_SEVERITY_ERROR
    WARNING = mavlink.MAV_SEVERITY_WARNING
    NOTICE = mavlink.MAV_SEVERITY_NOTICE
    INFO = mavlink.MAV_SEVERITY_INFO


class StatusReporter:
    """Queue of status texts of the companion ``own``.

    Texts wait here until ``due`` returns them. If ``config.texts`` is off all texts are discarded.
    """

    def __init__(self, config: GroundMessagesConfig, own: Source) -> None:
        self._on = config.texts
        self._own = own
        self._waiting: list[tuple[Severity, str]] = []
        self._wrong: set[str] = set()
        self._next = 0

    def say(self, severity: Severity, text: str) -> None:
        """Queue an event, unless the same text is waiting already."""
        if not self._on or any(text == one for _, one in self._waiting):
            return
        self._waiting.append((severity, text))
        if len(self._waiting) > _MAX_WAITING:
            # Drop the youngest of the least severe texts.
            worst = max(range(len(self._waiting)), key=lambda row: (self._waiting[row][0], row))
            del self._waiting[worst]

    def watch(self, wrong: bool, lost: str, back: str, severity: Severity = Severity.WARNING) -> None:
        """Report the begin of a condition by the text ``lost``, and its end by ``back``.

        ``wrong``: whether the condition is present; ``severity``: of its begin. ``lost`` identifies the
        condition. Repeated calls with the same state have no effect.
        """
        if wrong == (lost in self._wrong):
            return
        if wrong:
            self._wrong.add(lost)
            self.say(severity, lost)
        else:
            self._wrong.remove(lost)
            self.say(Severity.NOTICE, back)

    def report(self, severity: Severity, text: str, *, begins: bool) -> None:
        """Report an event by ``text``, or its end by "Over:" and the part of ``text`` before the colon."""
        if begins:
            self.say(severity, text)
        else:
            self.say(Severity.NOTICE, f"Over: {text.split(':')[0]}")

    def due(self, now: int) -> list[StatusText]:
        """Return the texts that may be sent at ``now`` (µs), the most severe first."""
        said = []
        while self._waiting and self._next - now <= (_BURST - 1) * _PERIOD_US:
            self._next = max(self._next, now) + _PERIOD_US
            first = min(range(len(self._waiting)), key=lambda row: (self._waiting[row][0], row))
            severity, text = self._waiting.pop(first)
            said.append(StatusText(self._own, severity, text))
        return said
