"""Signing of messages: SETUP_SIGNING (256), and warnings to senders whose messages are rejected."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal

from mavlink_bridge.messages import SetupSigning, Source
from mavlink_bridge.wire.signing import LATEST, Signing
from sitl.telemetry.status_text import StatusReporter

# µs between two warnings about rejected messages.
_WARNING_INTERVAL_US: Final = 5_000_000


class SigningSetup:
    """Handler that passes keys to ``signing``.

    As on real firmwares, a key message must address this vehicle alone, and none is accepted while armed. If
    a key is already set, only its owner can change it, because all messages must then be signed. The key is
    not kept over a restart: it would be stored in clear text in a file that is no key file.
    """

    def __init__(
        self,
        source: Source,
        signing: Signing | None,
        setup: Literal["refused", "obeyed"],
        armed: Callable[[], bool],
        status_text: StatusReporter,
    ) -> None:
        """Set the rules; without ``signing`` every message is accepted and every key refused."""
        self._source = source
        self._signing = signing
        self._obeys = setup == "obeyed"
        self._armed = armed
        self._status_text = status_text
        self._refused = 0
        self._next = 0

    def set_up(self, message: SetupSigning, now: int) -> None:
        """Handle SETUP_SIGNING (256) that arrived at ``now`` (µs). The only answer is a text."""
        if message.target_system != self._source.system:
            return
        reason = self._reason(message)
        if reason is not None or self._signing is None:
            self._status_text.complain(f"Signing setup refused: {reason}", now)
        elif message.key.blank:
            self._signing.use(None)
            self._status_text.inform("Signing is off")
        else:
            self._signing.use(message.key, message.since)
            self._status_text.inform("Signing is on")

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
        """Report at intervals why messages are rejected; their senders get no other indication."""
        signing = self._signing
        if signing is None or signing.latest is None or now < self._next:
            return
        refused = sum(signing.refused.values())
        if refused != self._refused:
            self._refused, self._next = refused, now + _WARNING_INTERVAL_US
            self._status_text.warn(f"Messages do not count: {signing.latest.value}")


def resumed(signing: Signing | None, setup: Literal["refused", "obeyed"], until: int) -> Signing | None:
    """Return the signing to use, if any: without ``signing`` one that ``setup`` may still bring a key to.

    Its timestamps continue those of an earlier run, which ended at ``until`` (10 µs since the start of 2015).
    """
    if signing is None and setup == "obeyed":
        signing = Signing()
    if signing is not None:
        signing.resume(until)
    return signing
