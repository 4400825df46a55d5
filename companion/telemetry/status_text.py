"""What a companion says to the ground: STATUSTEXT, each event once, never many at a time."""

from __future__ import annotations

from enum import IntEnum

from companion.config.flight import VoiceConfig
from mavlink_bridge.messages import Source, StatusText

_EVERY, _AT_ONCE = 1_000_000, 5
"""µs for a text; so many may come at once after a silence."""
_WAITING = 16
"""Texts that wait; beyond that the least severe is dropped."""


class Severity(IntEnum):
    """MAV_SEVERITY, those that are used."""

    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6


class StatusReporter:
    """Of the companion ``own``. Texts wait here until ``due``; without ``texts`` in ``config`` none does."""

    def __init__(self, config: VoiceConfig, own: Source) -> None:
        self._on = config.texts
        self._own = own
        self._waiting: list[tuple[Severity, str]] = []
        self._wrong: set[str] = set()
        self._next = 0

    def say(self, severity: Severity, text: str) -> None:
        """An event; one that waits already is not said twice."""
        if not self._on or any(text == one for _, one in self._waiting):
            return
        self._waiting.append((severity, text))
        if len(self._waiting) > _WAITING:
            # Of the least severe the youngest.
            worst = max(range(len(self._waiting)), key=lambda row: (self._waiting[row][0], row))
            del self._waiting[worst]

    def watch(self, wrong: bool, lost: str, back: str, severity: Severity = Severity.WARNING) -> None:
        """Something that may be ``wrong``: its beginning is said as ``lost``, its end as ``back``. Call it
        as often as you like; ``lost`` is its name."""
        if wrong == (lost in self._wrong):
            return
        if wrong:
            self._wrong.add(lost)
            self.say(severity, lost)
        else:
            self._wrong.remove(lost)
            self.say(Severity.NOTICE, back)

    def report(self, severity: Severity, text: str, *, begins: bool) -> None:
        """Something that began, or that is over: of an end, what comes before the colon."""
        if begins:
            self.say(severity, text)
        else:
            self.say(Severity.NOTICE, f"Over: {text.split(':')[0]}")

    def due(self, now: int) -> list[StatusText]:
        """What may be said at ``now`` (µs), the most severe first."""
        said = []
        while self._waiting and self._next - now <= (_AT_ONCE - 1) * _EVERY:
            self._next = max(self._next, now) + _EVERY
            first = min(range(len(self._waiting)), key=lambda row: (self._waiting[row][0], row))
            severity, text = self._waiting.pop(first)
            said.append(StatusText(self._own, severity, text))
        return said
