"""What the autopilot says to people: STATUSTEXT (253)."""

from __future__ import annotations

from typing import Final

from mavlink_bridge.messages import Message, Source, StatusText

# MAV_SEVERITY
_WARNING: Final = 4
_INFO: Final = 6

_SECOND: Final = 1_000_000
_REASONS: Final = 64


class Voice:
    """Appends texts to ``outbox``."""

    def __init__(self, source: Source, outbox: list[Message]) -> None:
        self._source = source
        self._outbox = outbox
        self._complaints: dict[str, int] = {}

    def inform(self, text: str) -> None:
        """Something happened as it should."""
        self._outbox.append(StatusText(self._source, _INFO, text))

    def warn(self, text: str) -> None:
        """Something was refused or went wrong."""
        self._outbox.append(StatusText(self._source, _WARNING, text))

    def complain(self, text: str, now: int) -> None:
        """Warn, but of the same thing at most once a second (``now`` in µs)."""
        if now - self._complaints.get(text, -_SECOND) < _SECOND:
            return
        if len(self._complaints) >= _REASONS:
            self._complaints = {said: then for said, then in self._complaints.items() if now - then < _SECOND}
        self._complaints[text] = now
        self.warn(text)
