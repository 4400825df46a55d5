"""Status texts for the ground (STATUSTEXT): each event once, at a bounded rate."""

from __future__ import annotations

from enum import IntEnum

from pymavlink.dialects.v20 import all as mavlink

from companion.config.flight import GroundMessagesConfig
from mavlink_bridge.messages import Source, StatusText

_EVERY, _AT_ONCE = 1_000_000, 5
"""µs per text, and the number of texts that may be sent at once after a pause."""
_WAITING = 16
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
        if len(self._waiting) > _WAITING:
            # The youngest of the least severe.
            worst = max(range(len(self._waiting)), key=lambda row: (self._waiting[row][0], row))
            del self._waiting[worst]

    def watch(self, wrong: bool, lost: str, back: str, severity: Severity = Severity.WARNING) -> None:
        """Report the beginning (``lost``) and the end (``back``) of a condition that may be ``wrong``.

        ``lost`` identifies the condition. Repeated calls with the same state have no effect.
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
        """Report an event that begins, or its end: "Over:" and the text before its colon."""
        if begins:
            self.say(severity, text)
        else:
            self.say(Severity.NOTICE, f"Over: {text.split(':')[0]}")

    def due(self, now: int) -> list[StatusText]:
        """Return the texts that may be sent at ``now`` (µs), the most severe first."""
        said = []
        while self._waiting and self._next - now <= (_AT_ONCE - 1) * _EVERY:
            self._next = max(self._next, now) + _EVERY
            first = min(range(len(self._waiting)), key=lambda row: (self._waiting[row][0], row))
            severity, text = self._waiting.pop(first)
            said.append(StatusText(self._own, severity, text))
        return said
