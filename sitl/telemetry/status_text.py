"""Texts of the autopilot for people: STATUSTEXT (253)."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Message, Source, StatusText

_SECOND: Final = 1_000_000
# Limit of complaints per second, against senders that make thousands of mistakes.
_MOST: Final = 32


class StatusReporter:
    """Sender of texts, which it appends to ``outbox``."""

    def __init__(self, source: Source, outbox: list[Message]) -> None:
        self._source = source
        self._outbox = outbox
        self._complaints: dict[str, int] = {}

    def inform(self, text: str) -> None:
        """Report normal events."""
        self._outbox.append(StatusText(self._source, mavlink.MAV_SEVERITY_INFO, text))

    def warn(self, text: str) -> None:
        """Report a refusal or a failure."""
        self._outbox.append(StatusText(self._source, mavlink.MAV_SEVERITY_WARNING, text))

    def complain(self, text: str, now: int) -> None:
        """Warn, at most once a second for the same text (``now`` in µs), and 32 times a second in all."""
        complaints = self._complaints
        if now - complaints.get(text, -_SECOND) < _SECOND:
            return
        if len(complaints) >= _MOST:
            for said in [said for said, then in complaints.items() if now - then >= _SECOND]:
                del complaints[said]
            if len(complaints) >= _MOST:
                return
        complaints[text] = now
        self.warn(text)
