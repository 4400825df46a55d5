"""Status texts of the autopilot: STATUSTEXT (253)."""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.messages import Message, Source, StatusText

_SECOND: Final = 1_000_000
# Limits the answers to a sender of thousands of faulty messages.
_MAX_WARNINGS_PER_S: Final = 32
_MAX_REMEMBERED: Final = 64


class StatusReporter:
    """Sender of texts, which it appends to ``outbox``."""

    def __init__(self, source: Source, outbox: list[Message]) -> None:
        self._source = source
        self._outbox = outbox
        self._complaints: dict[str, int] = {}
        self._said: set[str] = set()

    def inform(self, text: str) -> None:
        """Send ``text`` as information about a normal event."""
        self._outbox.append(StatusText(self._source, mavlink.MAV_SEVERITY_INFO, text))

    def warn(self, text: str) -> None:
        """Send ``text`` as a warning about a refusal or a failure."""
        self._outbox.append(StatusText(self._source, mavlink.MAV_SEVERITY_WARNING, text))

    def mention(self, text: str, now: int) -> None:
        """Warn once (``now`` in µs): a client that polls for what is not supported asks for ever.

        The first 64 texts are remembered; later ones are said as by ``complain``.
        """
        if text in self._said:
            return
        if len(self._said) < _MAX_REMEMBERED:
            self._said.add(text)
        self.complain(text, now)

    def complain(self, text: str, now: int) -> None:
        """Warn, at most once a second for the same text (``now`` in µs), and 32 times a second in all."""
        complaints = self._complaints
        if now - complaints.get(text, -_SECOND) < _SECOND:
            return
        if len(complaints) >= _MAX_WARNINGS_PER_S:
            for said in [said for said, then in complaints.items() if now - then >= _SECOND]:
                del complaints[said]
            if len(complaints) >= _MAX_WARNINGS_PER_S:
                return
        complaints[text] = now
        self.warn(text)
