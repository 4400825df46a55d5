"""Whom the autopilot believes: SETUP_SIGNING (256), and a word to those whose messages do not count."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal

from mavlink_bridge.messages import SetupSigning, Source
from mavlink_bridge.wire.signing import LATEST, Signing
from sitl.telemetry.status_text import Voice

# µs between two words about messages that do not count.
_PAUSE: Final = 5_000_000


class Trust:
    """Hands keys to ``signing``. As with the real ones only a message for this vehicle alone counts, and none
    in flight; and where there is a key already, its owner alone may change it, as all else has to be signed.

    The key is not kept over a restart: it would lie in clear in a file that is no key file.
    """

    def __init__(
        self,
        source: Source,
        signing: Signing | None,
        setup: Literal["refused", "obeyed"],
        armed: Callable[[], bool],
        voice: Voice,
    ) -> None:
        """Without ``signing`` every message counts, and no key is taken."""
        self._source = source
        self._signing = signing
        self._obeys = setup == "obeyed"
        self._armed = armed
        self._voice = voice
        self._refused = 0
        self._next = 0

    def set_up(self, message: SetupSigning, now: int) -> None:
        """SETUP_SIGNING (256) that arrived at ``now`` (µs). There is no answer to it but a text."""
        if message.target_system != self._source.system:
            return
        reason = self._reason(message)
        if reason is not None or self._signing is None:
            self._voice.complain(f"Signing setup refused: {reason}", now)
        elif message.key.blank:
            self._signing.use(None)
            self._voice.inform("Signing is off")
        else:
            self._signing.use(message.key, message.since)
            self._voice.inform("Signing is on")

    def _reason(self, message: SetupSigning) -> str | None:
        if not self._obeys or self._signing is None:
            return "keys come from a file here"
        if self._armed():
            return "armed"
        if message.since > LATEST:
            return "no such time"
        if message.key.blank and message.since:
            return "a key of zeros"
        return None

    def watch(self, now: int) -> None:
        """Say now and then why messages do not count, or their sender would never know."""
        signing = self._signing
        if signing is None or signing.latest is None or now < self._next:
            return
        refused = sum(signing.refused.values())
        if refused != self._refused:
            self._refused, self._next = refused, now + _PAUSE
            self._voice.warn(f"Messages do not count: {signing.latest.value}")
